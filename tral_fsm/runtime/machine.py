"""A machine at work: tick and transition. docs/state_machine.md explains the rules."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, cast

from tral_env.errors import MachineError, MachineRunError, reason
from tral_fsm.conditions.base import Condition, build
from tral_fsm.control.command import Command, is_command
from tral_fsm.definition.checks import FormatError, check
from tral_fsm.definition.conditions import CONDITIONS, ConditionSpec
from tral_fsm.definition.machine import STATES, Load, MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.definition.validated import Id
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import MachineHolder, State, Targetable


@dataclass(frozen=True)
class Transit:
    """One transition that fired, for the trace."""

    time: float
    """s on the machine's clock."""
    path: tuple[Id, ...]
    """Ids of the states around the machine, the outermost first."""
    source: Id
    target: Id
    transition: Id
    why: str
    """The compared values."""


Trace = Callable[[Transit], None]


class _Transition:
    """A transition at work."""

    __slots__ = ("condition", "spec", "target")

    def __init__(self, spec: TransitionSpec, condition: Condition[Any], target: int) -> None:
        self.spec = spec
        self.condition = condition
        self.target = target


class Machine:
    """Runs a definition: an estimate in, a command out."""

    def __init__(
        self,
        definition: MachineDefinition,
        trace: Trace | None = None,
        path: tuple[Id, ...] = (),
        *,
        load: Load | None = None,
        checked: bool = False,
    ) -> None:
        """Build states and transitions.

        Args:
            definition: what to run.
            trace: called for each transition that fires.
            path: ids of the states around this machine.
            load: for the packaged machines that the machine names, such as `tral_fsm.load_machine`.
            checked: the definition has been checked already.

        Raises:
            FormatError: the definition cannot run.
            MachineRunError: the code of a state or a condition fails.
            MachineError: it names a packaged machine, and there is no `load`.
        """
        problems = [] if checked else check(definition, load)
        if problems:
            raise FormatError(definition.name or "machine", problems)
        self.definition = definition
        self.trace = trace
        self.path = path
        index = {state.id: i for i, state in enumerate(definition.states)}
        self._inner: dict[int, Machine] = {}
        """Index of a state -> the machine that it holds."""
        self._states = [self._state(i, spec, load) for i, spec in enumerate(definition.states)]
        self._transitions: list[list[_Transition]] = [[] for _ in self._states]
        for spec in definition.transitions:
            source = index[spec.source]
            with self._blaming(spec, "when it was built"):
                condition = build(spec.when, self._states[source])
            self._transitions[source].append(_Transition(spec, condition, index[spec.target]))
        self._guards = [[(each.condition.triggered, each) for each in leaving] for leaving in self._transitions]
        """Of each state, the transitions that leave it, each behind the method that says whether it fires."""
        self._root = index[definition.root]
        self._active = -1

    def _state(self, index: int, spec: StateSpec, load: Load | None) -> State[Any]:
        with self._blaming(spec, "when it was built"):
            runtime: State[Any] = STATES.runtime(spec.type)(spec)
        inner = spec.inner
        if isinstance(inner, str):
            if load is None:
                raise MachineError(
                    f"state {spec.id!r} ({spec.type}) names the machine {inner!r}, and nothing loads it: "
                    "give load=tral_fsm.load_machine"
                )
            inner = load(inner)
        if inner is not None:
            held = Machine(inner, self.trace, (*self.path, spec.id), load=load, checked=True)
            self._inner[index] = held
            cast(MachineHolder, runtime).hold_machine(held)
        return runtime

    @property
    def active(self) -> State[Any]:
        """The active state; the root before the first tick."""
        return self._states[self.active_index]

    @property
    def active_index(self) -> int:
        """Place of the active state among those of the definition; that of the root before the first tick."""
        return self._active if self._active >= 0 else self._root

    @property
    def active_path(self) -> str:
        """Name of the active state: its label or id, then those of inner machines behind slashes."""
        index = self.active_index
        spec, inner = self._states[index].spec, self._inner.get(index)
        name = spec.label or str(spec.id)
        return name if inner is None else f"{name}/{inner.active_path}"

    @property
    def ended(self) -> bool:
        """Whether the active state may end the machine and has no transition that leaves it."""
        return self._active >= 0 and self.active.spec.may_end and not self._transitions[self._active]

    def start(self, estimate: CarEstimate) -> Detection | None:
        """Enter the root; gives the gate that the root chose as its target by itself."""
        return self._enter(self._root, estimate)

    def go_to(self, index: int, estimate: CarEstimate) -> Detection | None:
        """Let another state be active from now on, whether or not a transition fires.

        Args:
            index: its place among the states of the definition.
            estimate: of this tick.

        Returns:
            The gate that is now the target: the one that a transition to that state hands over, or its own.
        """
        if self._active < 0:
            self.start(estimate)
        leading = [each for leaving in (self._transitions[self._active], *self._transitions) for each in leaving]
        found = next((each for each in leading if each.target == index), None)
        if found is not None:
            return self._follow(found, estimate)
        self.leave(estimate)
        return self._enter(index, estimate)

    def leave(self, estimate: CarEstimate) -> None:
        """Leave the active state; the machine starts at its root the next time."""
        if self._active >= 0:
            with self._blaming(self.active.spec, _at(estimate)):
                self._states[self._active].on_exit(estimate)
        self._active = -1

    def restart(self) -> None:
        """Begin again at the root at the next tick. All is forgotten, and no `on_exit` is called."""
        self._active = -1
        for inner in self._inner.values():
            inner.restart()
        for transition in itertools.chain(*self._transitions):
            with self._blaming(transition.spec, "when it was restarted"):
                transition.condition.restart()

    def watch(self, trace: Trace | None) -> None:
        """Call `trace` for each transition that fires from now on, also in inner machines; None: call nothing."""
        self.trace = trace
        for inner in self._inner.values():
            inner.watch(trace)

    def retune(self, definition: MachineDefinition) -> None:
        """Go on with other parameters from the next tick on; nothing starts again.

        Args:
            definition: a machine that `check` accepts, with the same states, transitions and types.

        Raises:
            MachineError: it has others.
            MachineRunError: the code of a state or a condition fails.
        """
        if _shape(definition) != _shape(self.definition):
            raise MachineError("the machine that runs has other states, transitions or types: start the new one")
        for index, spec in enumerate(definition.states):
            with self._blaming(spec, "when it got other parameters"):
                self._states[index].retune(spec)
            if isinstance(spec.inner, MachineDefinition):
                self._inner[index].retune(spec.inner)
        mine = {transition.spec.id: transition for transition in itertools.chain(*self._transitions)}
        for each in definition.transitions:
            with self._blaming(each, "when it got other parameters"):
                mine[each.id].condition.retune(each.when)
            mine[each.id].spec = each
        self.definition = definition

    def shadow(self, estimate: CarEstimate) -> None:
        """Tell the active state before a tick that another policy drives the car."""
        if self._active >= 0:
            with self._blaming(self.active.spec, _at(estimate)):
                self._states[self._active].on_shadow(estimate)

    def tick(self, estimate: CarEstimate) -> Command:
        """Let the active state compute its command, then take the first of its transitions that fires.

        Args:
            estimate: of this tick.

        Returns:
            The command of the state that was active, with the target of the state that is entered.

        Raises:
            MachineRunError: the code of the state or of a condition raised an error, or the state answered no command,
                or one with a number that is not finite.
        """
        target = None
        if self._active < 0:
            target = self.start(estimate)
        fired, spec = None, self._states[self._active].spec
        try:
            command = self._states[self._active].tick(estimate)
            if not is_command(command):
                raise self._refused(command, estimate)
            for triggered, transition in self._guards[self._active]:
                spec = transition.spec
                if triggered(estimate):
                    fired = transition
                    break
        except MachineRunError:
            raise
        except Exception as error:
            raise self._failure(spec, _at(estimate), error) from error
        if fired is not None:
            target = self._transit(fired, estimate) or target
        return command if target is None else command._replace(target=target)

    def _refused(self, command: object, estimate: CarEstimate) -> MachineRunError:
        """Word the error for an answer of the active state that is no command of finite numbers."""
        spec = self.active.spec
        where = "/".join(str(part) for part in (*self.path, spec.id))
        return MachineRunError(
            f"state {where!r} ({spec.type}) answered {command!r} at {estimate.time:.4f} s: "
            "expected a Command whose steering, speed, throttle and steering_trim are None or finite, and whose "
            "wanted_side and wanted_clearance are finite or NaN"
        )

    def _failure(self, spec: StateSpec | TransitionSpec, when: str, error: Exception) -> MachineRunError:
        """Word the error that the code of a state or of the condition of a transition raised."""
        where = "/".join(str(part) for part in (*self.path, spec.id))
        if isinstance(spec, StateSpec):
            part, runtime = f"state {where} ({spec.type})", STATES.runtime(spec.type)
        else:
            kind = spec.when.type
            part, runtime = f"transition {where} ({kind}) from state {spec.source}", CONDITIONS.runtime(kind)
        file = getattr(sys.modules.get(runtime.__module__), "__file__", None)
        return MachineRunError(f"{part} failed {when}: {reason(error, file)}")

    @contextmanager
    def _blaming(self, spec: StateSpec | TransitionSpec, when: str) -> Iterator[None]:
        """Name a state or a transition in the error that its code raises."""
        try:
            yield
        except MachineRunError:
            raise
        except Exception as error:
            raise self._failure(spec, when, error) from error

    def _transit(self, transition: _Transition, estimate: CarEstimate) -> Detection | None:
        """Leave the old state, enter the new one, hand it its target; gives the gate that is now the target."""
        spec, condition, now = transition.spec, transition.condition, _at(estimate)
        with self._blaming(spec, now):
            if self.trace is not None:
                why = condition.why(estimate)
                self.trace(Transit(estimate.time, self.path, spec.source, spec.target, spec.id, why))
        return self._follow(transition, estimate)

    def _follow(self, transition: _Transition, estimate: CarEstimate) -> Detection | None:
        """`_transit` that nobody is told of."""
        now = _at(estimate)
        with self._blaming(transition.spec, now):
            handed_over = transition.condition.hand_over(estimate)
        with self._blaming(self.active.spec, now):
            self._states[self._active].on_exit(estimate)
        own_target = self._enter(transition.target, estimate)
        state = self._states[transition.target]
        if handed_over is None or handed_over.id < 0 or not state.spec.takes_target:
            return own_target
        with self._blaming(state.spec, now):
            cast(Targetable, state).set_target(estimate, estimate.seen_from_here(handed_over), gate=handed_over.id)
        return handed_over

    def _enter(self, index: int, estimate: CarEstimate) -> Detection | None:
        """Enter a state; gives the gate that the state chose as its target by itself."""
        self._active = index
        state, now = self._states[index], _at(estimate)
        with self._blaming(state.spec, now):
            state.on_enter(estimate)
        for transition in self._transitions[index]:
            with self._blaming(transition.spec, now):
                transition.condition.on_enter(estimate)
        return state.own_target


def _shape(machine: MachineDefinition) -> object:
    """A machine without its parameters: what `Machine.retune` cannot change."""
    states = [
        (state.id, state.type, _shape(inner) if isinstance(inner := state.inner, MachineDefinition) else inner)
        for state in machine.states
    ]
    return machine.root, states, [(t.id, t.source, t.target, _kinds(t.when)) for t in machine.transitions]


def _kinds(condition: ConditionSpec) -> tuple[Any, ...]:
    return condition.type, *map(_kinds, condition.parts)


def _at(estimate: CarEstimate) -> str:
    return f"at {estimate.time:.2f} s"
