"""States and conditions that drive by the walls of the blackboard instead of by the raw ranges.

The laws are those of `control.line`: a place in the corridor is kept by where the car is and how it points, both from
the observer in `walls`, so that jitter, recesses and openings do not reach the wheel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from pydantic import Field

from tral_env.interface import NO_ECHO_M
from tral_fsm.conditions import base as transitions
from tral_fsm.conditions.base import Condition
from tral_fsm.control.laws import clip, slowed, steering_for
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.machine import DrivingSpec
from tral_fsm.definition.validated import Side, quantity
from tral_fsm.estimation.estimator import MachineState
from tral_fsm.estimation.front_obstacle import Ahead
from tral_fsm.estimation.wall_filter import SENSOR_X
from tral_fsm.states import base as states
from tral_fsm.states.base import DrivingState, State

_QUARTER = math.pi / 2.0
_SURE_LOCK = 0.9
"""A linkage that is off does not reach full lock on one side, which dead reckoning cannot know. Source: choice."""
FRONT_X = 0.304
"""Front ultrasonic ahead of the rear axle, m."""
_LATE = 0.25
"""A turn takes so much more than its radius: late readings, slow servo, an end that dies away, m. Source: choice."""
_FADE = 0.6
"""The line comes to its place without a kink: over this length, m. Source: choice."""


class FollowCorridorSpec(DrivingSpec):
    """Keeps a place in the corridor: a clearance to the wall on `side`, at most half of what both sides have."""

    needs: ClassVar[Mapping[str, str]] = {"slow_front": "speed", "unsure_speed": "speed"}

    type: Literal["FollowCorridor"] = "FollowCorridor"
    side: Side = Field("right", description="the wall that the clearance is to")
    clearance: float = quantity(0.9, "m", "wanted range of that side's ultrasonic", gt=0.0, le=5.0)
    least: float = quantity(
        0.3, "m", "at least this much is kept to the other wall if it alone is known", ge=0.0, le=5.0
    )
    length: float = quantity(0.4, "m", "an offset from the line dies away by e in it", gt=0.0, le=5.0)
    slope: float = quantity(0.15, "", "the line shifts to the side by at most this, m for a metre", gt=0.0, le=1.0)
    shift: float = quantity(5.0, "m", "the line shifts towards `side` by no more than this altogether", gt=0.0, le=5.0)
    max_angle_deg: float = quantity(18.0, "deg", "the line is approached no steeper", gt=0.0, le=60.0)
    learn_trim: bool = Field(True, description="learn at which steering the car drives straight")
    unsure_speed: float | None = quantity(
        None,
        "m/s",
        "no faster while the corridor's direction or the trim is not known yet; null: never mind",
        gt=0.0,
        le=5.0,
    )
    slow_front: float | None = quantity(None, "m", "front range from which on the car slows down", gt=0.0, le=5.0)
    slow_speed: float = quantity(0.3, "m/s", "speed at half of slow_front and nearer", ge=0.0, le=5.0)


@states.runs(FollowCorridorSpec)
class FollowCorridor(DrivingState[FollowCorridorSpec]):
    """Follows a line in the corridor that begins where the car is and shifts to its place by a slope.

    The line is kept as a clearance to a wall: that of `side` if it is known, else the other one, else, by dead
    reckoning, nowhere. When the wall changes, or is found at another place, the line stays where it was and shifts.
    """

    def __init__(self, spec: FollowCorridorSpec) -> None:
        super().__init__(spec)
        self.preferred = spec.side == "left"
        self.steepest = math.sin(math.radians(spec.max_angle_deg))

    def on_enter(self, m: MachineState) -> None:
        """The line begins at the car."""
        self.offset = 0.0
        """Where the line is, + = left of the car, m."""
        self.reference = 0.0
        """Wall that it is kept to: +1 left, -1 right, 0 none."""
        self.clearance = math.nan
        """Of the line to that wall, m."""
        self.shifted = 0.0
        """How far it has shifted towards `side`, m."""
        self.moved = -1
        self.place = (m.x, m.y)
        self.driven = m.distance

    def tick(self, m: MachineState) -> None:
        """Move the line, steer onto it."""
        spec = self.spec
        if spec.learn_trim:
            m.take_trim()
        slope = self.shift(m)
        approach = clip(self.offset / (2.0 * spec.length) + slope, self.steepest)
        self.steer(m, clip(steering_for(2.0 / spec.length * (approach - math.sin(m.heading))), _SURE_LOCK))
        if self.reference:
            m.want_clearance(self.reference > 0.0, self.clearance)
        self.drive(m, self.speed_now(m))

    def shift(self, m: MachineState) -> float:
        """Find the line anew; gives the slope with which it moves to the left."""
        spec = self.spec
        along = m.yaw - m.heading
        x, y = self.place
        self.offset -= math.cos(along) * (m.y - y) - math.sin(along) * (m.x - x)
        self.place = (m.x, m.y)
        step, self.driven = m.distance - self.driven, m.distance
        preferred = self.preferred
        mine, other = m.clearance(preferred), m.clearance(not preferred)
        is_left, now = (preferred, mine) if mine == mine else (not preferred, other)
        if now != now:
            self.reference = 0.0
            return 0.0
        sign = 1.0 if is_left else -1.0
        moved = m.walls.side(is_left).moved
        if sign != self.reference or moved != self.moved:
            self.clearance = now - sign * self.offset
            self.reference, self.moved = sign, moved
        if is_left != preferred:
            wanted = max(self.clearance, spec.least)
        elif other == other:
            wanted = min(spec.clearance, (mine + other) / 2.0)
        else:
            wanted = spec.clearance
        slope = clip((wanted - self.clearance) / _FADE, spec.slope)
        self.shifted -= slope * step if is_left == preferred else -slope * step
        if self.shifted > spec.shift and (slope < 0.0) == (is_left == preferred):
            slope = 0.0
        self.clearance += slope * step
        self.offset = sign * (now - self.clearance)
        return -sign * slope

    def speed_now(self, m: MachineState) -> float | None:
        """Speed before something ahead, and while little is known of the corridor, m/s; None: as it is."""
        spec = self.spec
        free = spec.speed
        if free is not None and spec.unsure_speed is not None and not m.walls.sure:
            free = min(free, spec.unsure_speed)
        slow = slowed(free, spec.slow_speed, spec.slow_front, m.front.range)
        return free if slow is None else slow


class TurnSpec(DrivingSpec):
    """Turns into the corridor on `side`: full lock, then onto the direction a right angle away from this corridor's."""

    type: Literal["Turn"] = "Turn"
    side: Side = Field("left", description="to which side")
    room: float = quantity(
        0.65, "m", "the turn ends so far before the wall ahead, if lock and wall allow", gt=0.0, le=5.0
    )
    lock: float = quantity(0.85, "", "share of full lock at least", gt=0.0, le=1.0)
    length: float = quantity(0.4, "m", "the rest of the turn dies away by e in half of it", gt=0.0, le=5.0)
    tolerance_deg: float = quantity(2.0, "deg", "turned when no more than this is left", gt=0.0, le=45.0)

    @property
    def finishable(self) -> bool:
        """When turned."""
        return True


@states.runs(TurnSpec)
class Turn(DrivingState[TurnSpec]):
    """A quarter turn against the corridor, not against the heading that the car happened to have."""

    def on_enter(self, m: MachineState) -> None:
        """Aim at a right angle to the corridor."""
        self.finished = False
        sign = 1.0 if self.spec.side == "left" else -1.0
        self.aim = m.yaw - m.heading + sign * _QUARTER
        radius = max(m.ahead.range + FRONT_X - _LATE - self.spec.room, 0.1)
        self.lock = max(min(steering_for(1.0 / radius), _SURE_LOCK), self.spec.lock)

    def tick(self, m: MachineState) -> None:
        """Steer to that direction."""
        spec = self.spec
        rest = self.aim - m.yaw
        self.finished = abs(rest) <= math.radians(spec.tolerance_deg)
        self.steer(m, clip(steering_for(2.0 / spec.length * math.sin(clip(rest, _QUARTER))), self.lock))
        self.drive(m)


class BackUpSpec(DrivingSpec):
    """Reverses for a distance and turns back to the corridor's direction meanwhile. Stop before and after it."""

    type: Literal["BackUp"] = "BackUp"
    distance: float = quantity(0.7, "m", "hall distance", gt=0.0, le=100.0)
    length: float = quantity(0.4, "m", "the heading dies away by e in half of it", gt=0.0, le=5.0)

    @property
    def finishable(self) -> bool:
        """After its distance."""
        return True


@states.runs(BackUpSpec)
class BackUp(DrivingState[BackUpSpec]):
    """In reverse the wheels turn the car the other way."""

    def on_enter(self, m: MachineState) -> None:
        """Remember where it began."""
        self.finished = False
        self.entry = m.distance

    def tick(self, m: MachineState) -> None:
        """Drive back, wheels so that the car comes to point along the corridor."""
        self.finished = m.distance - self.entry >= self.spec.distance
        self.steer(m, steering_for(2.0 / self.spec.length * math.sin(m.heading)))
        self.drive(m)


class OpeningSpec(ConditionSpec):
    """Fires when there is no wall on a side: readings found none, though the car stood parallel to hear one."""

    type: Literal["Opening"] = "Opening"
    side: Side = Field("left", description="on which side")
    readings: int = Field(2, description="so many readings found none since one did", ge=2, le=100)


@transitions.runs(OpeningSpec)
class Opening(Condition[OpeningSpec]):
    """Asks the observer of the walls."""

    counts = False

    def __init__(self, spec: OpeningSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.is_left = spec.side == "left"

    def triggered(self, m: MachineState) -> bool:
        """The wall is lost."""
        return m.walls.side(self.is_left).lost >= self.spec.readings

    def why(self, m: MachineState) -> str:
        """How many readings."""
        return f"{m.walls.side(self.is_left).lost} readings without a wall on the {self.spec.side}"


class ObstacleAheadSpec(ConditionSpec):
    """Fires when front readings agree on something ahead that is nearer than a range, or than the car needs to stop.

    A wall across the corridor is heard from 5 m on, the edges of a box from 2 m on.
    """

    type: Literal["ObstacleAhead"] = "ObstacleAhead"
    below: float | None = quantity(
        None,
        "m",
        "it is nearer than this; null: than the way to stop, room + v reaction + v^2 / (2 braking)",
        gt=0.0,
        le=5.0,
    )
    room: float = quantity(0.3, "m", "left before it when the car has stopped", ge=0.0, le=5.0)
    reaction: float = quantity(0.4, "s", "readings, command and brake are late", ge=0.0, le=5.0)
    braking: float = quantity(1.5, "m/s^2", "deceleration of the braking car", gt=0.0, le=20.0)
    readings: int = Field(2, description="so many readings must agree on it", ge=2, le=100)
    heard_above: float = quantity(0.0, "m", "it has been heard from farther away than this", ge=0.0, le=6.0)
    heard_below: float = quantity(6.0, "m", "it has not been heard from farther away than this", gt=0.0, le=6.0)
    aside_below: float | None = quantity(
        None, "m", "it is no farther beside the way than this, as far as its approach tells; null: never mind", gt=0.0
    )


@transitions.runs(ObstacleAheadSpec)
class ObstacleAhead(Condition[ObstacleAheadSpec]):
    """Asks what the blackboard knows of what is ahead.

    What has only just come up counts too, unless it is asked what it is: then something else may be followed still.
    """

    counts = False

    def __init__(self, spec: ObstacleAheadSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.below = spec.below
        self.anything = spec.heard_above == 0.0 and spec.heard_below >= NO_ECHO_M and spec.aside_below is None

    def level(self, m: MachineState) -> float:
        """Range below which it fires, m."""
        spec, v = self.spec, m.speed
        return spec.room + v * (spec.reaction + v / (2.0 * spec.braking)) if self.below is None else self.below

    def triggered(self, m: MachineState) -> bool:
        """Near, and first heard where it should be."""
        ahead = m.ahead
        level = self.below or self.level(m)
        if ahead.range < level and self.known(ahead):
            return True
        return self.anything and ahead.last < level and ahead.run >= self.spec.readings

    def known(self, ahead: Ahead) -> bool:
        """It has been heard often enough, from where it should be, and where it should be."""
        spec = self.spec
        if ahead.agreed < spec.readings or not spec.heard_above < ahead.heard_from <= spec.heard_below:
            return False
        return spec.aside_below is None or ahead.aside < spec.aside_below

    def why(self, m: MachineState) -> str:
        """How near, and from where on."""
        ahead = m.ahead
        return (
            f"{ahead.near:.2f} < {self.level(m):.2f} m ahead, {ahead.aside:.2f} m aside, "
            f"heard from {ahead.heard_from:.2f} m on"
        )


class MoreRoomSpec(ConditionSpec):
    """Fires when there is more room on a side than on the other: when the wall there is farther away, or not known.

    Where something is ahead its place counts, not the car's: a car that drives aslant comes to it nearer to a wall.
    """

    type: Literal["MoreRoom"] = "MoreRoom"
    side: Side = Field("left", description="on which side")


@transitions.runs(MoreRoomSpec)
class MoreRoom(Condition[MoreRoomSpec]):
    """Compares the walls."""

    counts = False

    def __init__(self, spec: MoreRoomSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.is_left = spec.side == "left"

    def triggered(self, m: MachineState) -> bool:
        """More room there."""
        ahead = self.place(m)
        here, there = m.clearance(self.is_left, ahead), m.clearance(not self.is_left, ahead)
        return here > there or (here != here and there == there)

    @staticmethod
    def place(m: MachineState) -> float:
        """How far ahead of the side ultrasonics what is ahead is, m; 0: nothing is."""
        near = m.ahead.near
        return FRONT_X - SENSOR_X + near if near < math.inf else 0.0

    def why(self, m: MachineState) -> str:
        """Both clearances."""
        ahead = self.place(m)
        return f"left {m.clearance(True, ahead):.2f} m, right {m.clearance(False, ahead):.2f} m, {ahead:.2f} m ahead"
