"""A machine at work: tick and transit. The rules stand in docs/state_machine.md."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tral_fsm.conditions.base import Condition, build
from tral_fsm.definition.checks import FormatError, check
from tral_fsm.definition.machine import FSMStateSpec, MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.definition.validated import Id
from tral_fsm.estimation.estimator import MachineState
from tral_fsm.formats import library
from tral_fsm.states.base import NO_GATE, RUNTIMES, State, Targetable, runs


@dataclass(frozen=True)
class Transit:
    """One transition that fired, for the trace."""

    time: float
    """s on the machine's clock."""
    path: tuple[Id, ...]
    """Ids of the states around the machine, outermost first, that it happened in."""
    source: Id
    target: Id
    transition: Id
    why: str
    """The values that were compared."""


Trace = Callable[[Transit], None]


class _Way:
    """A transition at work."""

    __slots__ = ("condition", "spec", "target")

    def __init__(self, spec: TransitionSpec, condition: Condition[Any], target: int) -> None:
        self.spec = spec
        self.condition = condition
        self.target = target


class Machine:
    """Runs a definition on a blackboard."""

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
        problems = [] if checked else [*check(definition), *library.check_inner(definition)]
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
        runtime = RUNTIMES[spec.type](spec)
        if isinstance(runtime, FSMState):
            runtime.attach(self.trace, (*self.path, spec.id))
        return runtime

    @property
    def active(self) -> State[Any]:
        """The active state; the root before the first tick."""
        return self._states[self._active if self._active >= 0 else self._root]

    @property
    def active_path(self) -> str:
        """Name of the active state: its label or id, with those of inner machines behind a slash."""
        active = self.active
        name = active.spec.label or str(active.spec.id)
        return f"{name}/{active.machine.active_path}" if isinstance(active, FSMState) else name

    @property
    def ended(self) -> bool:
        """The active state is one that the machine ends in, and has no way out."""
        return self._active >= 0 and self.active.spec.may_end and not self._ways[self._active]

    def start(self, m: MachineState) -> None:
        """Enter the root."""
        self._enter(self._root, m)

    def leave(self, m: MachineState) -> None:
        """Leave the active state; the machine starts at its root the next time."""
        if self._active >= 0:
            self._states[self._active].on_exit(m)
        self._active = -1

    def restart(self) -> None:
        """Begin again at the root at the next tick, as if nothing had been: no `on_exit` is called."""
        self._active = -1
        for state in self._states:
            if isinstance(state, FSMState):
                state.machine.restart()

    def watch(self, trace: Trace | None) -> None:
        """Call this for each transition that fires from now on, in machines inside too; None: nothing."""
        self.trace = trace
        for state in self._states:
            if isinstance(state, FSMState):
                state.machine.watch(trace)

    def tick(self, m: MachineState) -> None:
        """The active state computes its output; then the first of its transitions that has triggered is taken.

        Args:
            m: the blackboard, updated with the readings of this tick.
        """
        if self._active < 0:
            self.start(m)
        self._states[self._active].tick(m)
        for triggered, way in self._asked[self._active]:
            if triggered(m):
                self._transit(way, m)
                break

    def _transit(self, way: _Way, m: MachineState) -> None:
        """Leave the old state, enter the new one, hand it its target."""
        if self.trace is not None:
            spec = way.spec
            self.trace(Transit(m.time, self.path, spec.source, spec.target, spec.id, way.condition.why(m)))
        found = way.condition.hand_over(m)
        self._states[self._active].on_exit(m)
        self._enter(way.target, m)
        state = self._states[way.target]
        if found is not None and isinstance(state, Targetable):
            m.gates.aim(found)
            state.set_target(m, *m.from_here(found.x, found.y, found.heading), gate=found.id)

    def _enter(self, index: int, m: MachineState) -> None:
        self._active = index
        self._states[index].on_enter(m)
        for way in self._ways[index]:
            way.condition.on_enter(m)


@runs(FSMStateSpec)
class FSMState(State[FSMStateSpec]):
    """A whole machine as one state. It starts at its root at each entry. Finished when its machine has ended.

    A target that is handed over goes to the root; the active inner state says whether it can still be reached.
    """

    machine: Machine

    def attach(self, trace: Trace | None, path: tuple[Id, ...]) -> None:
        """Build the inner machine.

        Args:
            trace: of the outer machine.
            path: ids of the states around the inner machine.
        """
        inner = self.spec.machine
        if isinstance(inner, str):
            inner = library.by_name(inner)
        self.machine = Machine(inner, trace, path, checked=True)

    def on_enter(self, m: MachineState) -> None:
        """Enter the inner root."""
        self.machine.start(m)

    def tick(self, m: MachineState) -> None:
        """Tick the inner machine."""
        self.machine.tick(m)

    def set_target(self, m: MachineState, x: float, y: float, heading: float, gate: int = NO_GATE) -> None:
        """Hand the target on to the inner root, which has just been entered."""
        root = self.machine.active
        if isinstance(root, Targetable):
            root.set_target(m, x, y, heading, gate)

    def unreachable(self, m: MachineState) -> str:
        """Why the active inner state cannot come to its target any more."""
        return self.machine.active.unreachable(m)

    def on_exit(self, m: MachineState) -> None:
        """Leave the inner active state."""
        self.machine.leave(m)

    @property
    def finished(self) -> bool:
        """The inner machine has come to its end."""
        return self.machine.ended
