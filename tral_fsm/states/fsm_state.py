"""A whole machine as one state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Literal, Protocol

from pydantic import Field

from tral_env.se2 import Pose
from tral_fsm.control.command import Command
from tral_fsm.definition.machine import MachineDefinition, StateSpec
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import NO_GATE, State, Targetable


class InnerMachine(Protocol):
    """What the state needs of its machine."""

    @property
    def active(self) -> State[Any]:
        """The active state."""
        ...

    @property
    def ended(self) -> bool:
        """The machine has come to its end."""
        ...

    @property
    def active_path(self) -> str:
        """Name of the active state."""
        ...

    def start(self, estimate: CarEstimate) -> Detection | None:
        """Enter the root."""
        ...

    def tick(self, estimate: CarEstimate) -> Command:
        """The active state's command."""
        ...

    def leave(self, estimate: CarEstimate) -> None:
        """Leave the active state."""

    def restart(self) -> None:
        """Begin again at the root at the next tick."""

    def watch(self, trace: Callable[[Any], None] | None) -> None:
        """Call this for each transition that fires."""


class FSMStateSpec(StateSpec):
    """Runs a whole machine as one state, given inline or by the name of a packaged one. Its root takes the target."""

    holds_machine: ClassVar[bool] = True
    never_finishes_hint: ClassVar[str] = "its machine has no state in which it may end"

    type: Literal["FSMState"] = "FSMState"
    machine: MachineDefinition | str = Field(description="the inner machine, or the name of a packaged one")

    @property
    def finishable(self) -> bool:
        """The state is finished when its machine has ended. For a packaged machine that is checked at loading."""
        return isinstance(self.machine, str) or self.machine.may_end

    @property
    def takes_target(self) -> bool:
        """The state takes a target if the root of its machine does. For a packaged one that is checked at loading."""
        if isinstance(self.machine, str):
            return True
        root = self.machine.root
        return any(state.id == root and state.takes_target for state in self.machine.states)

    @property
    def inner(self) -> MachineDefinition | str:
        """Its machine."""
        return self.machine


class FSMState(State[FSMStateSpec]):
    """A whole machine as one state. It starts at its root at each entry and is finished when its machine has ended.

    A target that is handed over goes to the root; the active inner state says whether it can still be reached.
    """

    machine: InnerMachine
    """Set by the machine around it."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Enter the inner root."""
        self.machine.start(estimate)

    def tick(self, estimate: CarEstimate) -> Command:
        """Tick the inner machine."""
        return self.machine.tick(estimate)

    @property
    def aim(self) -> Detection | None:  # type: ignore[override]
        """The gate that the inner root has chosen."""
        return self.machine.active.aim

    def set_target(self, estimate: CarEstimate, target: Pose, gate: int = NO_GATE) -> None:
        """Hand the target on to the inner root, which has just been entered."""
        root = self.machine.active
        if isinstance(root, Targetable):
            root.set_target(estimate, target, gate)

    def unreachable(self, estimate: CarEstimate) -> str:
        """Why the active inner state cannot reach its target any more; empty: it can."""
        return self.machine.active.unreachable(estimate)

    def on_exit(self, estimate: CarEstimate) -> None:
        """Leave the inner active state."""
        self.machine.leave(estimate)

    @property
    def finished(self) -> bool:
        """The inner machine has come to its end."""
        return self.machine.ended
