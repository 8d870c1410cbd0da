"""A whole machine as one state."""

from __future__ import annotations

from typing import ClassVar, Literal, cast

from pydantic import Field

from tral_env.se2 import Pose
from tral_fsm.control.command import Command
from tral_fsm.definition.machine import MachineDefinition, StateSpec
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import NO_GATE, InnerMachine, State, Targetable


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


class FSMState(State[FSMStateSpec]):
    """A whole machine as one state. It starts at its root at each entry and is finished when its machine has ended.

    A target that is handed over goes to the root; the active inner state says whether it can still be reached.
    """

    machine: InnerMachine

    def hold_machine(self, machine: InnerMachine) -> None:
        """Run this machine."""
        self.machine = machine

    def on_enter(self, estimate: CarEstimate) -> None:
        """Enter the inner root."""
        self.machine.start(estimate)

    def tick(self, estimate: CarEstimate) -> Command:
        """Tick the inner machine."""
        return self.machine.tick(estimate)

    @property
    def own_target(self) -> Detection | None:  # type: ignore[override]
        """The gate that the inner root has chosen."""
        return self.machine.active.own_target

    def set_target(self, estimate: CarEstimate, target: Pose, gate: int = NO_GATE) -> None:
        """Hand the target on to the inner root, which has just been entered."""
        root = self.machine.active
        if root.spec.takes_target:
            cast(Targetable, root).set_target(estimate, target, gate)

    def unreachable(self, estimate: CarEstimate) -> str:
        """Why the active inner state cannot reach its target any more; empty: it can."""
        return self.machine.active.unreachable(estimate)

    def on_shadow(self, estimate: CarEstimate) -> None:
        """Tell the inner machine."""
        self.machine.shadow(estimate)

    def on_exit(self, estimate: CarEstimate) -> None:
        """Leave the inner active state."""
        self.machine.leave(estimate)

    @property
    def finished(self) -> bool:
        """The inner machine has come to its end."""
        return self.machine.ended
