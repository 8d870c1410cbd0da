"""Conditions on the distance, the time, the heading, the state that is left, and the raw ranges."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, cast

from pydantic import Field

from tral_env.errors import MachineError
from tral_env.interface import NO_ECHO_M
from tral_fsm.conditions.base import Condition
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.needs import DISTANCE, ultrasonic
from tral_fsm.definition.validated import SonarName, quantity, required
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import Finishable, State

_ROUNDING_S = 5e-10
"""A time that is short of its limit by rounding alone counts as over, s."""


class AlwaysSpec(ConditionSpec):
    """Fires at once."""

    type: Literal["Always"] = "Always"

    @property
    def holds_always(self) -> bool:
        """The condition holds in every tick."""
        return True


class Always(Condition[AlwaysSpec]):
    """Fires at once: in the tick in which its owner computed its first command."""

    counts = False

    def triggered(self, estimate: CarEstimate) -> bool:
        """Always true."""
        return True


class DistanceSpec(ConditionSpec):
    """Fires when the car has driven a distance in the state."""

    type: Literal["Distance"] = "Distance"
    distance: float = required("m", "distance since entry, by the hall sensor", ge=0.0, le=10000.0)

    @property
    def holds_always(self) -> bool:
        """Whether there is no distance to drive."""
        return self.distance == 0.0

    @property
    def readings_needed(self) -> frozenset[str]:
        """The hall sensor counts the distance."""
        return DISTANCE


class Distance(Condition[DistanceSpec]):
    """Fires after a distance."""

    counts = False

    def __init__(self, spec: DistanceSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.entry = 0.0
        """`CarEstimate.distance` at entry, m."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember where the owner began."""
        self.entry = estimate.distance

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the car has driven far enough."""
        return estimate.distance - self.entry >= self.spec.distance

    def why(self, estimate: CarEstimate) -> str:
        """Distance driven and distance wanted."""
        return f"driven {estimate.distance - self.entry:.3f} >= {self.spec.distance:g} m"


class TimerSpec(ConditionSpec):
    """Fires after a time in the state."""

    type: Literal["Timer"] = "Timer"
    seconds: float = required("s", "time since entry", ge=0.0, le=100000.0)

    @property
    def holds_always(self) -> bool:
        """Whether there is no time to wait."""
        return self.seconds == 0.0


class Timer(Condition[TimerSpec]):
    """Fires after a time."""

    counts = False

    def __init__(self, spec: TimerSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.entry = 0.0
        """Time at entry, s."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember when the owner began."""
        self.entry = estimate.time

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the time is over."""
        return estimate.time - self.entry >= self.spec.seconds - _ROUNDING_S

    def why(self, estimate: CarEstimate) -> str:
        """Time since entry and time wanted."""
        return f"{estimate.time - self.entry:.3f} >= {self.spec.seconds:g} s"


class TurnedSpec(ConditionSpec):
    """Fires when the car has turned by an angle in the state, by dead reckoning, to either side."""

    type: Literal["Turned"] = "Turned"
    angle_deg: float = required("deg", "angle since entry", gt=0.0, le=3600.0)

    @property
    def readings_needed(self) -> frozenset[str]:
        """Dead reckoning."""
        return DISTANCE


class Turned(Condition[TurnedSpec]):
    """Fires after a turn by dead reckoning."""

    counts = False

    def __init__(self, spec: TurnedSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.angle = math.radians(spec.angle_deg)
        self.entry = 0.0
        """`CarEstimate.yaw` at entry, rad."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember the heading."""
        self.entry = estimate.yaw

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the car has turned far enough, to either side."""
        return abs(estimate.yaw - self.entry) >= self.angle

    def why(self, estimate: CarEstimate) -> str:
        """Angle turned and angle wanted."""
        return f"turned {math.degrees(estimate.yaw - self.entry):+.1f}, {self.spec.angle_deg:g} deg wanted"


class AlignedSpec(ConditionSpec):
    """Fires when the car points along or across the corridor, whose direction it knows from following walls.

    At an angle of more than about 22 degrees a wall gives no echo, so that it looks like an opening.
    """

    type: Literal["Aligned"] = "Aligned"
    angle_deg: float = quantity(12.0, "deg", "largest angle to that direction", gt=0.0, le=45.0)

    @property
    def readings_needed(self) -> frozenset[str]:
        """Dead reckoning, and a wall to know the corridor by, which the states that follow one ask for."""
        return DISTANCE


class Aligned(Condition[AlignedSpec]):
    """Fires when the car points along or across the corridor."""

    counts = False

    def __init__(self, spec: AlignedSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.angle = math.radians(spec.angle_deg)

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the heading is within the angle."""
        return abs(estimate.heading) <= self.angle

    def why(self, estimate: CarEstimate) -> str:
        """Heading and angle."""
        return f"heading {math.degrees(estimate.heading):+.1f} within {self.spec.angle_deg:g} deg"


class FinishedSpec(ConditionSpec):
    """Fires when the state says that it is finished."""

    asks_owner_finished: ClassVar[bool] = True

    type: Literal["Finished"] = "Finished"


class Finished(Condition[FinishedSpec]):
    """Fires when its owner says that it is finished."""

    counts = False

    def __init__(self, spec: FinishedSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        if not owner.spec.finishable:
            raise MachineError(f"{spec.type} leaves {type(owner).__qualname__}, which never finishes")
        self.finishable = cast(Finishable, owner)

    def triggered(self, estimate: CarEstimate) -> bool:
        """Ask the owner."""
        return self.finishable.finished

    def why(self, estimate: CarEstimate) -> str:
        """The state that is finished."""
        return f"{self.owner.spec.type} is finished"


class UnreachableSpec(ConditionSpec):
    """Fires when the state cannot reach its target any more: it lies behind the car, or needs too tight a turn."""

    asks_owner_target: ClassVar[bool] = True

    type: Literal["Unreachable"] = "Unreachable"
    seconds: float = quantity(
        0.0,
        "s",
        "time for which the target must be out of reach without a break, so that one bad detection does not count",
        ge=0.0,
        le=60.0,
    )

    @property
    def readings_needed(self) -> frozenset[str]:
        """Dead reckoning."""
        return DISTANCE


class Unreachable(Condition[UnreachableSpec]):
    """Fires when its owner has said for long enough why it cannot come to its target."""

    def __init__(self, spec: UnreachableSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.counts = spec.seconds > 0.0
        self.since = math.inf
        """Time since which the target has been out of reach, s; infinite: it is within reach."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Begin: the target counts as within reach."""
        self.since = math.inf

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether there has been a reason for long enough."""
        self.since = min(self.since, estimate.time) if self.owner.unreachable(estimate) else math.inf
        return estimate.time - self.since >= self.spec.seconds - _ROUNDING_S

    def why(self, estimate: CarEstimate) -> str:
        """The reason."""
        return self.owner.unreachable(estimate) or "the target is within reach"


class SensorLevelSpec(ConditionSpec):
    """Fires when an ultrasonic reads above or below a level. No echo counts as above."""

    exactly_one: ClassVar[tuple[str, ...]] = ("above", "below")

    type: Literal["SensorLevel"] = "SensorLevel"
    sensor: SonarName = Field("front", description="which ultrasonic")
    above: float | None = quantity(None, "m", "fires when the range is above", ge=0.0, lt=NO_ECHO_M)
    below: float | None = quantity(None, "m", "fires when the range is below", gt=0.0, le=NO_ECHO_M)
    readings: int = Field(1, description="number of readings in a row that must agree", ge=1, le=100)

    @property
    def readings_needed(self) -> frozenset[str]:
        """The range of its sensor."""
        return ultrasonic(self.sensor)


class SensorLevel(Condition[SensorLevelSpec]):
    """Fires when an ultrasonic is above or below a level.

    The last reading before entry counts as the first one; later readings count when they are new.
    """

    def __init__(self, spec: SensorLevelSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.is_below = spec.below is not None
        self.level = cast(float, spec.below if self.is_below else spec.above)  # a file gives exactly one
        self.agreed = 0
        self.fresh = True

    def on_enter(self, estimate: CarEstimate) -> None:
        """Begin: no reading has agreed yet."""
        self.agreed = 0
        self.fresh = True

    def triggered(self, estimate: CarEstimate) -> bool:
        """Count readings in a row that agree."""
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
