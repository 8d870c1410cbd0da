"""Conditions on the way, the time, the heading, the owner and the raw ranges."""

from __future__ import annotations

import math
from typing import Any

from tral_fsm.conditions.base import Condition
from tral_fsm.definition.conditions import (
    AlignedSpec,
    AlwaysSpec,
    DistanceSpec,
    FinishedSpec,
    SensorLevelSpec,
    TimerSpec,
    TurnedSpec,
    UnreachableSpec,
)
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import State


class Always(Condition[AlwaysSpec]):
    """Fires at once: in the tick in which its owner computed its first output."""

    counts = False

    def triggered(self, estimate: CarEstimate) -> bool:
        """Always."""
        return True


class Distance(Condition[DistanceSpec]):
    """Fires after a hall distance."""

    counts = False

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember where it began."""
        self.entry = estimate.distance

    def triggered(self, estimate: CarEstimate) -> bool:
        """Driven far enough."""
        return estimate.distance - self.entry >= self.spec.distance

    def why(self, estimate: CarEstimate) -> str:
        """Driven and wanted."""
        return f"driven {estimate.distance - self.entry:.3f} >= {self.spec.distance:g} m"


class Timer(Condition[TimerSpec]):
    """Fires after a time."""

    counts = False

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember when it began."""
        self.entry = estimate.time

    def triggered(self, estimate: CarEstimate) -> bool:
        """Long enough; half a nanosecond of rounding is forgiven."""
        return estimate.time - self.entry >= self.spec.seconds - 5e-10

    def why(self, estimate: CarEstimate) -> str:
        """Time since entry and wanted."""
        return f"{estimate.time - self.entry:.3f} >= {self.spec.seconds:g} s"


class Turned(Condition[TurnedSpec]):
    """Fires after a turn by dead reckoning."""

    counts = False

    def __init__(self, spec: TurnedSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.angle = math.radians(spec.angle_deg)

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember the heading."""
        self.entry = estimate.yaw

    def triggered(self, estimate: CarEstimate) -> bool:
        """Turned far enough, to either side."""
        return abs(estimate.yaw - self.entry) >= self.angle

    def why(self, estimate: CarEstimate) -> str:
        """Turned and wanted."""
        return f"turned {math.degrees(estimate.yaw - self.entry):+.1f}, {self.spec.angle_deg:g} deg wanted"


class Aligned(Condition[AlignedSpec]):
    """Fires when the car points along or across the corridor."""

    counts = False

    def __init__(self, spec: AlignedSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.angle = math.radians(spec.angle_deg)

    def triggered(self, estimate: CarEstimate) -> bool:
        """Within the angle."""
        return abs(estimate.heading) <= self.angle

    def why(self, estimate: CarEstimate) -> str:
        """Heading and angle."""
        return f"heading {math.degrees(estimate.heading):+.1f} within {self.spec.angle_deg:g} deg"


class Finished(Condition[FinishedSpec]):
    """Fires when its owner says that it is finished."""

    counts = False

    def triggered(self, estimate: CarEstimate) -> bool:
        """Ask the owner."""
        return bool(self.owner.finished)  # type: ignore[attr-defined]

    def why(self, estimate: CarEstimate) -> str:
        """The state that is finished."""
        return f"{self.owner.spec.type} is finished"


class Unreachable(Condition[UnreachableSpec]):
    """Fires when its owner has said for long enough why it cannot come to its target."""

    def __init__(self, spec: UnreachableSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.counts = spec.seconds > 0.0

    def on_enter(self, estimate: CarEstimate) -> None:
        """It is within reach so far."""
        self.since = math.inf

    def triggered(self, estimate: CarEstimate) -> bool:
        """There has been a reason all the time."""
        self.since = min(self.since, estimate.time) if self.owner.unreachable(estimate) else math.inf
        return estimate.time - self.since >= self.spec.seconds - 5e-10

    def why(self, estimate: CarEstimate) -> str:
        """The reason."""
        return self.owner.unreachable(estimate) or "the target is within reach"


class SensorLevel(Condition[SensorLevelSpec]):
    """Fires when an ultrasonic is above or below a level.

    The reading that stands at entry counts as the first one; later ones count when they are new.
    """

    def __init__(self, spec: SensorLevelSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.is_below = spec.below is not None
        self.level = spec.below if spec.below is not None else spec.above if spec.above is not None else math.nan
        self.agreed = 0
        self.fresh = True

    def on_enter(self, estimate: CarEstimate) -> None:
        """No reading has agreed yet."""
        self.agreed = 0
        self.fresh = True

    def triggered(self, estimate: CarEstimate) -> bool:
        """Count readings that agree, one after the other."""
        sonar = getattr(estimate, self.spec.sensor)
        if sonar.new or self.fresh:
            self.fresh = False
            agrees = sonar.range < self.level if self.is_below else sonar.range > self.level
            self.agreed = self.agreed + 1 if agrees else 0
        return self.agreed >= self.spec.readings

    def why(self, estimate: CarEstimate) -> str:
        """Range and level."""
        reading = getattr(estimate, self.spec.sensor).range
        return f"{self.spec.sensor} {reading:.3f} {'<' if self.is_below else '>'} {self.level:g} m"
