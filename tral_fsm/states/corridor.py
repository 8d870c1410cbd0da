"""States that drive by the walls of the estimate instead of by the raw ranges.

They steer by `control.laws.line`: the car keeps a line in the corridor by its place and its heading. Both come from the
filter of the walls, so that noise, recesses and openings do not reach the wheels.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field

from tral_env.geometry import FRONT_SONAR_X_M
from tral_env.se2 import clip
from tral_fsm.control.command import Command
from tral_fsm.control.laws import clipped_steering_for, line, slowed
from tral_fsm.definition.machine import DrivingSpec, StateSpec, steering_trim
from tral_fsm.definition.needs import DISTANCE, NOTHING, SIDES, ultrasonic
from tral_fsm.definition.validated import Side, quantity, required
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.wall_filter import to_left
from tral_fsm.states.base import NO_CLEARANCE, DrivingState, State

_QUARTER = math.pi / 2.0
_SURE_LOCK = 0.9
"""Share of full lock that a car with a badly set linkage reaches on both sides. Source: choice."""
_LATE = 0.25
"""Room that a turn takes beyond its radius, for late readings, a slow servo and a soft end, m. Source: choice."""
_FADE = 0.6
"""Length over which the line comes to its place, so that it has no kink, m. Source: choice."""


class FollowCorridorSpec(DrivingSpec):
    """Keeps a line in the corridor: a clearance to the wall on `side`, at most half of the free width."""

    needs: ClassVar[Mapping[str, str]] = {"slow_front": "speed", "unsure_speed": "speed"}
    former: ClassVar[tuple[str, ...]] = ("learn_trim",)

    type: Literal["FollowCorridor"] = "FollowCorridor"
    side: Side = Field("right", description="the wall that the clearance is to")
    clearance: float = quantity(0.9, "m", "wanted range of that side's ultrasonic", gt=0.0, le=5.0)
    least: float = quantity(
        0.3, "m", "smallest clearance to the other wall while only that one is known", ge=0.0, le=5.0
    )
    length: float = quantity(0.4, "m", "an offset from the line falls to 1/e over this length", gt=0.0, le=5.0)
    slope: float = quantity(0.15, "", "the line shifts sideways by at most this per metre driven", gt=0.0, le=1.0)
    shift: float = quantity(5.0, "m", "the line shifts towards `side` by at most this in all", gt=0.0, le=5.0)
    max_angle_deg: float = quantity(18.0, "deg", "largest angle at which the car approaches the line", gt=0.0, le=60.0)
    unsure_speed: float | None = quantity(
        None,
        "m/s",
        "no faster while the corridor's direction or the trim is not known yet; null: never mind",
        gt=0.0,
        le=5.0,
    )
    slow_front: float | None = quantity(None, "m", "front range below which the car slows down", gt=0.0, le=5.0)
    slow_speed: float = quantity(0.3, "m/s", "speed at half of slow_front and below", ge=0.0, le=5.0)

    @property
    def readings_needed(self) -> frozenset[str]:
        """Both walls, the way between two readings, and the front range if something ahead slows the car."""
        return (
            super().readings_needed | DISTANCE | SIDES | (NOTHING if self.slow_front is None else ultrasonic("front"))
        )


class FollowCorridor(DrivingState[FollowCorridorSpec]):
    """Follows a line in the corridor that begins where the car is and shifts to its place by a slope.

    The line is kept as a clearance to a wall: that of `side` if it is known, else the other one, else, by dead
    reckoning, nowhere. When the wall changes, or is found at another place, the line stays where it was and shifts.
    """

    offset = 0.0
    """Place of the line beside the car, + = left, m."""
    reference = 0.0
    """Wall that the line is measured from: +1 left, -1 right, 0 none."""
    clearance = math.nan
    """Clearance of the line to that wall, m."""
    moved = -1
    """How often that wall has been found at another place, when the line was measured from it."""
    shifted = 0.0
    """Shift of the line towards `side` so far, m."""
    place = (0.0, 0.0)
    """x and y of the car in the tick before, m."""
    driven = 0.0
    """Distance driven up to the tick before, m."""

    def __init__(self, spec: FollowCorridorSpec) -> None:
        super().__init__(spec)
        self.prefers_left = spec.side == "left"
        self.steepest = math.radians(spec.max_angle_deg)

    def on_enter(self, estimate: CarEstimate) -> None:
        """Begin with a line at the car."""
        self.offset = self.reference = self.shifted = 0.0
        self.clearance = math.nan
        self.moved = -1
        self.place = (estimate.x, estimate.y)
        self.driven = estimate.distance

    def on_shadow(self, estimate: CarEstimate) -> None:
        """Begin the line anew at the car: a policy that has not followed the old one cannot see it."""
        self.offset = self.reference = 0.0
        self.place = (estimate.x, estimate.y)

    def tick(self, estimate: CarEstimate) -> Command:
        """Move the line, steer onto it."""
        self.carry_line(estimate)
        slope = self.shift_line(estimate)
        steering = line(-self.offset, estimate.heading, self.spec.length, self.steepest, slope)
        wanted = (self.reference, self.clearance) if self.reference else NO_CLEARANCE
        return self.drive(clip(steering, _SURE_LOCK), self.speed_now(estimate), wanted=wanted)

    def carry_line(self, estimate: CarEstimate) -> None:
        """Keep the line where it is in the frame of dead reckoning while the car moves."""
        x, y = self.place
        self.offset -= to_left(estimate.x - x, estimate.y - y, estimate.along)
        self.place = (estimate.x, estimate.y)

    def shift_line(self, estimate: CarEstimate) -> float:
        """Shift the line a step towards its place.

        Returns:
            Slope of the line, m to the left for a metre driven.
        """
        spec, preferred = self.spec, self.prefers_left
        step, self.driven = estimate.distance - self.driven, estimate.distance
        left, right = estimate.clearances()
        mine, other = (left, right) if preferred else (right, left)
        is_left, now = (preferred, mine) if not math.isnan(mine) else (not preferred, other)
        if math.isnan(now):
            self.reference = 0.0
            return 0.0
        self.measure_line(estimate, is_left, now)
        slope = clip((self.wanted(mine, other) - self.clearance) / _FADE, spec.slope)
        towards_side = -slope if is_left == preferred else slope
        self.shifted += towards_side * step
        if self.shifted > spec.shift and towards_side > 0.0:
            slope = 0.0
        self.clearance += slope * step
        sign = self.reference
        self.offset = sign * (now - self.clearance)
        return -sign * slope

    def measure_line(self, estimate: CarEstimate, is_left: bool, now: float) -> None:
        """Measure the line from a wall, unless it is measured from it already.

        Args:
            estimate: of this tick.
            is_left: the wall is the left one.
            now: clearance of the car to it, m.
        """
        sign, moved = 1.0 if is_left else -1.0, estimate.wall(is_left).moved
        if sign != self.reference or moved != self.moved:
            self.clearance = now - sign * self.offset
            self.reference, self.moved = sign, moved

    def wanted(self, mine: float, other: float) -> float:
        """Clearance that the line shifts to, m.

        Args:
            mine: clearance of the car to the wall on `side`, m; NaN: not known.
            other: clearance to the other wall, m; NaN: not known. One of both is known.
        """
        spec = self.spec
        if math.isnan(mine):
            return max(self.clearance, spec.least)
        return spec.clearance if math.isnan(other) else min(spec.clearance, (mine + other) / 2.0)

    def speed_now(self, estimate: CarEstimate) -> float | None:
        """Speed before something ahead, and while little is known of the corridor, m/s; None: as it is."""
        spec = self.spec
        free = spec.speed
        if free is not None and spec.unsure_speed is not None and not estimate.sure:
            free = min(free, spec.unsure_speed)
        slow = slowed(free, spec.slow_speed, spec.slow_front, estimate.front.range)
        return free if slow is None else slow


class TurnSpec(DrivingSpec):
    """Turns into the corridor on `side`, to a direction at a right angle to this corridor."""

    type: Literal["Turn"] = "Turn"
    side: Side = Field("left", description="the side to which the car turns")
    room: float = quantity(0.65, "m", "wanted distance to the wall ahead at the end of the turn", gt=0.0, le=5.0)
    lock: float = quantity(0.85, "", "smallest share of full lock at the beginning of the turn", gt=0.0, le=1.0)
    length: float = quantity(0.4, "m", "the rest of the turn falls to 1/e over half of this length", gt=0.0, le=5.0)
    tolerance_deg: float = quantity(2.0, "deg", "the turn is finished when no more than this is left", gt=0.0, le=45.0)

    @property
    def finishable(self) -> bool:
        """The state is finished when the car has turned."""
        return True

    @property
    def readings_needed(self) -> frozenset[str]:
        """Dead reckoning tells how far the car has turned."""
        return super().readings_needed | DISTANCE


class Turn(DrivingState[TurnSpec]):
    """A quarter turn measured from the corridor's direction, not from the heading that the car has at entry."""

    finished = False
    target_yaw = 0.0
    """rad, in the frame of dead reckoning."""
    lock = 1.0
    """Share of full lock to which the steering is limited."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Aim at a right angle to the corridor."""
        self.finished = False
        sign = 1.0 if self.spec.side == "left" else -1.0
        self.target_yaw = estimate.along + sign * _QUARTER
        radius = max(estimate.obstacle.range + FRONT_SONAR_X_M - _LATE - self.spec.room, 0.1)
        self.lock = max(min(clipped_steering_for(1.0 / radius), _SURE_LOCK), self.spec.lock)

    def tick(self, estimate: CarEstimate) -> Command:
        """Steer to that direction."""
        spec = self.spec
        turned_too_far = estimate.yaw - self.target_yaw
        self.finished = abs(turned_too_far) <= math.radians(spec.tolerance_deg)
        return self.drive(clip(line(0.0, clip(turned_too_far, _QUARTER), spec.length), self.lock))


class BackUpSpec(StateSpec):
    """Reverses for a distance and turns the car along the corridor. A Stop belongs before and after it."""

    type: Literal["BackUp"] = "BackUp"
    throttle: float = required("", "fixed, in reverse gear, so below 0", ge=-1.0, lt=0.0)
    steering_trim: float = steering_trim()
    distance: float = quantity(0.7, "m", "distance to reverse", gt=0.0, le=100.0)
    length: float = quantity(
        0.4, "m", "the angle to the corridor falls to 1/e over half of this length", gt=0.0, le=5.0
    )

    @property
    def finishable(self) -> bool:
        """The state is finished after its distance."""
        return True

    @property
    def readings_needed(self) -> frozenset[str]:
        """The hall sensor counts the distance."""
        return super().readings_needed | DISTANCE


class BackUp(State[BackUpSpec]):
    """Drives in reverse, where the wheels turn the car the other way."""

    finished = False
    entry = 0.0
    """`CarEstimate.distance` at entry, m."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember where the state began."""
        self.finished = False
        self.entry = estimate.distance

    def tick(self, estimate: CarEstimate) -> Command:
        """Steer so that the car points along the corridor in the end."""
        spec = self.spec
        self.finished = estimate.distance - self.entry >= spec.distance
        forward = line(0.0, estimate.heading, spec.length)
        return Command(-forward, throttle=spec.throttle, steering_trim=spec.steering_trim)
