"""A machine at work: tick and transition. docs/state_machine.md explains the rules."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tral_env.errors import MachineError
from tral_fsm.conditions.base import Condition, build
from tral_fsm.control.command import Command, is_command
from tral_fsm.definition.checks import FormatError, check
from tral_fsm.definition.machine import STATES, MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.definition.validated import Id
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.formats import library
from tral_fsm.states.base import State, Targetable
from tral_fsm.states.fsm_state import FSMState


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


class _Way:
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
        checked: bool = False,
    ) -> None:
        """Build states and transitions.

        Args:
            definition: what to run.
            trace: called for each transition that fires.
            path: ids of the states around this machine.
            checked: the definition has been checked already.

        Raises:
            FormatError: the definition cannot run.
        """
        problems = [] if checked else check(definition, library.by_name)
        if problems:
            raise FormatError(definition.name or "machine", problems)
        self.definition = definition
        self.trace = trace
        self.path = path
        index = {state.id: i for i, state in enumerate(definition.states)}
        self._states: list[State[Any]] = [self._state(spec) for spec in definition.states]
        self._ways: list[list[_Way]] = [[] for _ in self._states]
        for spec in definition.transitions:
            source = index[spec.source]
            self._ways[source].append(_Way(spec, build(spec.when, self._states[source]), index[spec.target]))
        self._asked = [[(way.condition.triggered, way) for way in ways] for ways in self._ways]
        self._root = index[definition.root]
        self._active = -1

    def _state(self, spec: StateSpec) -> State[Any]:
        runtime: State[Any] = STATES.runtime(spec.type)(spec)
        if isinstance(runtime, FSMState):
            inner = runtime.spec.machine
            inner = library.by_name(inner) if isinstance(inner, str) else inner
            runtime.machine = Machine(inner, self.trace, (*self.path, spec.id), checked=True)
        return runtime

    @property
    def active(self) -> State[Any]:
        """The active state; the root before the first tick."""
        return self._states[self._active if self._active >= 0 else self._root]

    @property
    def active_path(self) -> str:
        """Name of the active state: its label or id, then those of inner machines behind slashes."""
        active = self.active
        name = active.spec.label or str(active.spec.id)
        return f"{name}/{active.machine.active_path}" if isinstance(active, FSMState) else name

    @property
    def ended(self) -> bool:
        """Whether the active state may end the machine and has no transition that leaves it."""
        return self._active >= 0 and self.active.spec.may_end and not self._ways[self._active]

    def start(self, estimate: CarEstimate) -> Detection | None:
        """Enter the root; gives the gate that the root chose as its target by itself."""
        return self._enter(self._root, estimate)

    def leave(self, estimate: CarEstimate) -> None:
        """Leave the active state; the machine starts at its root the next time."""
        if self._active >= 0:
            self._states[self._active].on_exit(estimate)
        self._active = -1

    def restart(self) -> None:
        """Begin again at the root at the next tick. All is forgotten, and no `on_exit` is called."""
        self._active = -1
        for state in self._states:
            if isinstance(state, FSMState):
                state.machine.restart()
        for way in itertools.chain(*self._ways):
            way.condition.restart()

    def watch(self, trace: Trace | None) -> None:
        """Call `trace` for each transition that fires from now on, also in inner machines; None: call nothing."""
        self.trace = trace
        for state in self._states:
            if isinstance(state, FSMState):
                state.machine.watch(trace)

    def tick(self, estimate: CarEstimate) -> Command:
        """Let the active state compute its command, then take the first of its transitions that fires.

        Args:
            estimate: of this tick.

        Returns:
            The command of the state that was active, with the target of the state that is entered.

        Raises:
            MachineError: the state answered no command, or one with a number that is not finite.
        """
        entered = None
        if self._active < 0:
            entered = self.start(estimate)
        command = self._states[self._active].tick(estimate)
        if not is_command(command):
            raise self._refused(command, estimate)
        if entered is not None:
            command = command._replace(target=entered)
        for triggered, way in self._asked[self._active]:
            if triggered(estimate):
                target = self._transit(way, estimate)
                return command if target is None else command._replace(target=target)
        return command

    def _refused(self, command: object, estimate: CarEstimate) -> MachineError:
        """Word the error for an answer of the active state that is no command of finite numbers."""
        spec = self.active.spec
        where = "/".join(str(part) for part in (*self.path, spec.id))
        return MachineError(
            f"state {where!r} ({spec.type}) answered {command!r} at {estimate.time:.4f} s: "
            "expected a Command whose steering, speed, throttle and steering_trim are None or finite, and whose "
            "wanted_side and wanted_clearance are finite or NaN"
        )

    def _transit(self, way: _Way, estimate: CarEstimate) -> Detection | None:
        """Leave the old state, enter the new one, hand it its target."""
        if self.trace is not None:
            spec = way.spec
            self.trace(
                Transit(estimate.time, self.path, spec.source, spec.target, spec.id, way.condition.why(estimate))
            )
        found = way.condition.hand_over(estimate)
        self._states[self._active].on_exit(estimate)
        aim = self._enter(way.target, estimate)
        state = self._states[way.target]
        if found is None or not isinstance(state, Targetable):
            return aim
        state.set_target(estimate, estimate.seen_from_here(found), gate=found.id)
        return found

    def _enter(self, index: int, estimate: CarEstimate) -> Detection | None:
        """Enter a state; gives the gate that the state chose as its target by itself."""
        self._active = index
        state = self._states[index]
        state.on_enter(estimate)
        for way in self._ways[index]:
            way.condition.on_enter(estimate)
        return state.aim
