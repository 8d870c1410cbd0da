"""A condition that keeps a machine from trying the same for ever."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from tral_fsm.conditions.base import Condition
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.validated import quantity
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import State


class AgainSpec(ConditionSpec):
    """Fires when its state is entered again and again at one place: what was tried there does not lead on."""

    type: Literal["Again"] = "Again"
    times: int = Field(2, description="entered so often", ge=2, le=1000)
    within: float = quantity(2.0, "m", "of the first time, by dead reckoning along the way", gt=0.0, le=1000.0)


class RetryLimit(Condition[AgainSpec]):
    """Counts entries. A drive that begins anew counts from one."""

    counts = False

    def __init__(self, spec: AgainSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.restart()

    def restart(self) -> None:
        """Forget all: a drive begins anew."""
        self.place = 0.0
        self.entries = 0

    def on_enter(self, estimate: CarEstimate) -> None:
        """One more, or the first one at another place."""
        if self.entries == 0 or abs(estimate.arc_length - self.place) > self.spec.within:
            self.place, self.entries = estimate.arc_length, 0
        self.entries += 1

    def triggered(self, estimate: CarEstimate) -> bool:
        """Often enough."""
        return self.entries >= self.spec.times

    def why(self, estimate: CarEstimate) -> str:
        """How often."""
        return f"entered {self.entries} times within {self.spec.within:g} m"
