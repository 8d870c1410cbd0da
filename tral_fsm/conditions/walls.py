"""Conditions on what is beside and ahead of the car: walls, openings, obstacles."""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import Field

from tral_env.geometry import FRONT_SONAR_X_M, SIDE_SONAR_X_M
from tral_env.interface import NO_ECHO_M
from tral_fsm.conditions.base import Condition
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.needs import DISTANCE, HALL, SIDES, ultrasonic
from tral_fsm.definition.validated import Side, quantity
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.front_obstacle import FrontObstacle
from tral_fsm.states.base import State


class OpeningSpec(ConditionSpec):
    """Fires when there is no wall on a side: readings found none although the car was parallel enough to hear one."""

    type: Literal["Opening"] = "Opening"
    side: Side = Field("left", description="the side of the opening")
    readings: int = Field(
        2, description="number of readings without a wall since the last one with a wall", ge=2, le=100
    )

    @property
    def readings_needed(self) -> frozenset[str]:
        """The range of its side, and the way between two readings."""
        return ultrasonic(self.side) | DISTANCE


class Opening(Condition[OpeningSpec]):
    """Asks the filter of the walls."""

    counts = False

    def __init__(self, spec: OpeningSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.is_left = spec.side == "left"

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the wall is lost."""
        return estimate.wall(self.is_left).lost >= self.spec.readings

    def why(self, estimate: CarEstimate) -> str:
        """The number of readings without a wall."""
        return f"{estimate.wall(self.is_left).lost} readings without a wall on the {self.spec.side}"


class ObstacleAheadSpec(ConditionSpec):
    """Fires when front readings agree on an obstacle that is nearer than a range, or nearer than the car needs to stop.

    The car first hears a wall across the corridor at 5 m, the edges of a box at 2 m.
    """

    type: Literal["ObstacleAhead"] = "ObstacleAhead"
    below: float | None = quantity(
        None,
        "m",
        "the obstacle is nearer than this; null: than the way to stop, room + v reaction + v^2 / (2 braking)",
        gt=0.0,
        le=5.0,
    )
    room: float = quantity(0.3, "m", "distance left before the obstacle when the car has stopped", ge=0.0, le=5.0)
    reaction: float = quantity(0.4, "s", "delay of readings, command and brake together", ge=0.0, le=5.0)
    braking: float = quantity(1.5, "m/s^2", "deceleration of the braking car", gt=0.0, le=20.0)
    readings: int = Field(2, description="number of readings that must agree on the obstacle", ge=2, le=100)
    heard_above: float = quantity(
        0.0, "m", "the car first heard the obstacle from farther away than this", ge=0.0, le=NO_ECHO_M
    )
    heard_below: float = quantity(
        NO_ECHO_M, "m", "the car did not hear the obstacle from farther away than this", gt=0.0, le=NO_ECHO_M
    )
    aside_below: float | None = quantity(
        None,
        "m",
        "the obstacle is nearer to the car's way than this, told by six readings over about 25 cm; before, the "
        "condition does not fire; null: anywhere",
        gt=0.0,
    )

    @property
    def any_obstacle(self) -> bool:
        """Whether any obstacle counts, wherever it was first heard and however far aside it is."""
        return self.heard_above == 0.0 and self.heard_below >= NO_ECHO_M and self.aside_below is None

    @property
    def readings_needed(self) -> frozenset[str]:
        """The front range; a stopping distance needs the speed, an obstacle that is followed the way."""
        front = ultrasonic("front")
        if self.below is None:
            return front | HALL
        return front if self.any_obstacle else front | DISTANCE


class ObstacleAhead(Condition[ObstacleAheadSpec]):
    """Asks the tracker of the front obstacle. With L the level of the file, it fires when one of two rules holds:

    - the tracked obstacle: range < L, and it is known, see `_is_known`;
    - an obstacle that has just appeared, while the tracker may still follow another one: last_range < L and
      streak >= readings. This rule holds only where the file accepts any obstacle.
    """

    counts = False

    def __init__(self, spec: ObstacleAheadSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.below = spec.below
        self.any_obstacle = spec.any_obstacle

    def _level(self, estimate: CarEstimate) -> float:
        """Range below which the condition fires, m."""
        if self.below is not None:
            return self.below
        spec, v = self.spec, estimate.speed
        return spec.room + v * (spec.reaction + v / (2.0 * spec.braking))

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the obstacle is near, and is one that the file asks for."""
        ahead, level = estimate.obstacle, self.below
        if level is None:
            level = self._level(estimate)
        if ahead.range < level and self._is_known(ahead):
            return True
        return self.any_obstacle and ahead.last_range < level and ahead.streak >= self.spec.readings

    def _is_known(self, ahead: FrontObstacle) -> bool:
        """Whether readings enough agree on the obstacle, and it was first heard and lies where the file says.

        How far aside it lies is told by six readings over about 25 cm. Until then it is NaN, which is below no limit.
        """
        spec = self.spec
        if ahead.support < spec.readings or not spec.heard_above < ahead.first_range <= spec.heard_below:
            return False
        return spec.aside_below is None or ahead.lateral_offset < spec.aside_below

    def why(self, estimate: CarEstimate) -> str:
        """How near the obstacle is, and where it was first heard."""
        ahead = estimate.obstacle
        return (
            f"{ahead.nearest:.2f} < {self._level(estimate):.2f} m ahead, {ahead.lateral_offset:.2f} m aside, "
            f"heard from {ahead.first_range:.2f} m on"
        )


class MoreRoomSpec(ConditionSpec):
    """Fires when one side has more room than the other: its wall is farther away, or not known.

    If an obstacle is ahead, the room beside the obstacle counts, since a car that drives at an angle comes nearer to
    one wall on the way.
    """

    type: Literal["MoreRoom"] = "MoreRoom"
    side: Side = Field("left", description="the side that has more room")

    @property
    def readings_needed(self) -> frozenset[str]:
        """Both side ranges, and the way between two readings."""
        return SIDES | DISTANCE


class MoreRoom(Condition[MoreRoomSpec]):
    """Compares the clearances to both walls."""

    counts = False

    def __init__(self, spec: MoreRoomSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.is_left = spec.side == "left"

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the side has more room."""
        left, right = estimate.clearances(self._distance_to_obstacle(estimate))
        here, there = (left, right) if self.is_left else (right, left)
        return here > there or (math.isnan(here) and not math.isnan(there))

    @staticmethod
    def _distance_to_obstacle(estimate: CarEstimate) -> float:
        """Distance from the side ultrasonics to the obstacle ahead, m; 0: no obstacle."""
        near = estimate.obstacle.nearest
        return FRONT_SONAR_X_M - SIDE_SONAR_X_M + near if near < math.inf else 0.0

    def why(self, estimate: CarEstimate) -> str:
        """Both clearances."""
        ahead = self._distance_to_obstacle(estimate)
        left, right = estimate.clearances(ahead)
        return f"left {left:.2f} m, right {right:.2f} m, {ahead:.2f} m ahead"
