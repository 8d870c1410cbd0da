"""A condition that limits how often a machine tries the same thing."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from tral_fsm.conditions.base import Condition
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.needs import DISTANCE
from tral_fsm.definition.validated import quantity
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import State


class RetryLimitSpec(ConditionSpec):
    """Fires when the machine enters the state several times at one place, so that it can try something else."""

    type: Literal["Again"] = "Again"
    times: int = Field(2, description="number of entries at which it fires", ge=2, le=1000)
    within: float = quantity(
        2.0, "m", "entries count within this distance of the first one, along the way", gt=0.0, le=1000.0
    )

    @property
    def readings_needed(self) -> frozenset[str]:
        """The way between two entries."""
        return DISTANCE


class RetryLimit(Condition[RetryLimitSpec]):
    """Counts entries. A new drive counts from one."""

    counts = False

    def __init__(self, spec: RetryLimitSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.restart()

    def restart(self) -> None:
        """Forget everything: a new drive begins."""
        self.place = 0.0
        self.entries = 0

    def on_enter(self, estimate: CarEstimate) -> None:
        """Count one more entry, or the first one at another place."""
        if self.entries == 0 or abs(estimate.arc_length - self.place) > self.spec.within:
            self.place, self.entries = estimate.arc_length, 0
        self.entries += 1

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether there were enough entries."""
        return self.entries >= self.spec.times

    def why(self, estimate: CarEstimate) -> str:
        """The number of entries."""
        return f"entered {self.entries} times within {self.spec.within:g} m"
