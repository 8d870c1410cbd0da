"""Wall following: the law of 2016, in states that differ in their clearance and in the readings that they accept."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, TypeVar

from pydantic import Field

from tral_env.interface import NO_ECHO_M
from tral_env.se2 import Pose, clip, rotate
from tral_fsm.control.command import Command
from tral_fsm.control.laws import MIN_DAMPED_MPS, damping, line, pid, pid_rate, ramp, slowed
from tral_fsm.definition.machine import DrivingSpec
from tral_fsm.definition.needs import DISTANCE, NOTHING, SIDES, ultrasonic
from tral_fsm.definition.validated import Side, quantity
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.sonar import SonarReading
from tral_fsm.states.base import NO_GATE, DrivingState

_HOLD_LENGTH = 0.4
"""Length in which the car turns back to the corridor's direction when its wall is lost, m. Source: choice."""


class WallSpec(DrivingSpec):
    """Base of the specs of states that keep a clearance to a wall."""

    needs: ClassVar[Mapping[str, str]] = {"slow_front": "speed"}
    former: ClassVar[tuple[str, ...]] = ("learn_trim",)

    side: Side = Field("right", description="the wall that the car follows")
    p: float = quantity(1.2, "1/m", "steering per metre of deviation e", ge=0.0, le=1000.0)
    i: float = quantity(0.0, "1/(m s)", "steering per metre of deviation in a second", ge=0.0, le=1000.0)
    d: float | None = quantity(
        1.5,
        "s/m",
        "steering per m/s by which e grows; null: what gives p a damping ratio of 0.707 at the car's speed",
        null="auto",
        ge=0.0,
        le=1000.0,
    )
    derivative: Literal["sonar", "tick"] = Field(
        "sonar",
        description="sonar: e grows from one reading to the next; tick: from tick to tick, the exact law of 2016",
    )
    max_error: float | None = quantity(0.4, "m", "e is limited to this; null: no limit", gt=0.0, le=6.0)
    max_angle_deg: float | None = quantity(
        18.0,
        "deg",
        "e is limited so that the car approaches the wall no steeper: a steep wall gives no echo; null: no limit",
        gt=0.0,
        le=90.0,
    )
    max_rate: float = quantity(
        0.5, "m/s", "the change of e over the sonar's interval is limited to this", gt=0.0, le=1000.0
    )
    reach: float = quantity(
        2.5, "m", "a longer range is no wall: the car then keeps the direction of the corridor", gt=0.0, le=NO_ECHO_M
    )
    at_most_half: bool = Field(False, description="the wanted clearance is at most half of the sum of both side ranges")
    slow_front: float | None = quantity(None, "m", "front range below which the car slows down", gt=0.0, le=5.0)
    slow_speed: float = quantity(0.3, "m/s", "speed at half of slow_front and below", ge=0.0, le=5.0)

    @property
    def readings_needed(self) -> frozenset[str]:
        """The range of the followed side, and of others if they change the clearance or the speed."""
        ranges = SIDES if self.at_most_half else ultrasonic(self.side)
        return super().readings_needed | ranges | (NOTHING if self.slow_front is None else ultrasonic("front"))


W = TypeVar("W", bound=WallSpec)


class WallState(DrivingState[W]):
    """Wall following. Derived states say which clearance they want and which readings they accept.

    Steering is + to the left, so that the law's y is the steering at a left wall and its negative at a right one. If
    the followed side gives no echo, or one beyond `reach`, the car turns along the corridor and keeps that direction.
    """

    def __init__(self, spec: W) -> None:
        super().__init__(spec)
        self.is_left = spec.side == "left"
        self.sign = 1.0 if self.is_left else -1.0
        self.limit = math.inf if spec.max_error is None else spec.max_error
        self.steepest: float | None = None
        """Sine of the largest angle to the wall at which p e and d e' are in balance; None: no limit."""
        if spec.max_angle_deg is not None and spec.derivative == "sonar" and spec.p > 0.0 and spec.d != 0.0:
            self.steepest = math.sin(math.radians(spec.max_angle_deg))
        self.range: float | None = None
        """Last accepted range of the followed wall, m; None: no wall."""
        self.rate = 0.0
        """Change of that range over the sonar's last interval, m/s."""
        self.error_sum = 0.0
        self.error_old: float | None = None

    def on_enter(self, estimate: CarEstimate) -> None:
        """Begin with the range that the sonar reads now; e - eold and esum are 0."""
        self.rate = self.error_sum = 0.0
        self.error_old = None
        sonar = estimate.sonar(self.is_left)
        self.range = sonar.range if sonar.range <= self.spec.reach else None

    def tick(self, estimate: CarEstimate) -> Command:
        """Compute one tick of the control law."""
        spec = self.spec
        sonar = estimate.left if self.is_left else estimate.right
        if sonar.new:
            self.take_reading(sonar)
        wanted = self.wanted(estimate)
        if self.range is None:
            y = self.sign * hold_course(estimate)
            self.error_old = None
        else:
            if spec.at_most_half:
                wanted = min(wanted, self.half(estimate))
            d = damping(spec.p, estimate.speed) if spec.d is None else spec.d
            error = clip(self.range - wanted, self.largest(d, estimate.speed))
            self.error_sum += error
            if spec.derivative == "tick":
                y = pid(spec.p, spec.i, d, error, self.error_sum, error if self.error_old is None else self.error_old)
            else:
                y = pid_rate(spec.p, spec.i, d, error, self.error_sum, self.rate)
            self.error_old = error
        return self.drive(self.sign * y, self.speed_now(estimate), wanted=(self.sign, wanted))

    def largest(self, d: float, speed: float) -> float:
        """Limit of e, m."""
        if self.steepest is None:
            return self.limit
        return min(self.limit, self.steepest * d * max(speed, MIN_DAMPED_MPS) / self.spec.p)

    def accepts(self, sonar: SonarReading) -> bool:
        """Whether to use a new reading."""
        return True

    def wanted(self, estimate: CarEstimate) -> float:
        """Clearance wanted now, m."""
        raise NotImplementedError

    def take_reading(self, sonar: SonarReading) -> None:
        """Take a new reading of the followed side."""
        spec = self.spec
        if sonar.range > spec.reach:
            self.range = None
            self.rate = 0.0
        elif self.range is None or self.accepts(sonar):
            known = self.range is not None and sonar.previous <= spec.reach
            self.range = sonar.range
            if known and sonar.interval > 0.0:
                self.rate = clip((sonar.range - sonar.previous) / sonar.interval, spec.max_rate)
            else:
                self.rate = 0.0

    def half(self, estimate: CarEstimate) -> float:
        """Half of the free width beside the car, m."""
        other = (estimate.right if self.is_left else estimate.left).range
        mine = self.range
        return math.inf if mine is None or other > self.spec.reach else (mine + other) / 2.0

    def speed_now(self, estimate: CarEstimate) -> float | None:
        """Speed, slower before something ahead, m/s; None: the throttle is fixed."""
        spec = self.spec
        return slowed(spec.speed, spec.slow_speed, spec.slow_front, estimate.front.range)


def hold_course(estimate: CarEstimate) -> float:
    """Steering that turns the car back to the corridor's direction and keeps it there."""
    return line(0.0, estimate.heading, _HOLD_LENGTH)


def _clearance() -> Any:
    return quantity(0.8, "m", "wanted range of the side ultrasonic", gt=0.0, le=5.0)


class BasicFollowWallSpec(WallSpec):
    """Keeps a clearance to one wall: y = p e + i esum PID_S + d (e - eold) PID_INVS, e = range - clearance."""

    type: Literal["BasicFollowWall"] = "BasicFollowWall"
    clearance: float = _clearance()


class BasicFollowWall(WallState[BasicFollowWallSpec]):
    """Wall following that accepts every reading."""

    def wanted(self, estimate: CarEstimate) -> float:
        """Clearance wanted, m."""
        return self.spec.clearance


class FollowWallSpec(WallSpec):
    """Follows a wall and ignores sudden changes of the range, so that door frames do not disturb it."""

    type: Literal["FollowWall"] = "FollowWall"
    clearance: float = _clearance()
    ignore_jump: float = quantity(0.02, "m", "a larger change from one reading to the next is ignored", gt=0.0, le=6.0)


class FollowWall(WallState[FollowWallSpec]):
    """Wall following that ignores readings which differ from the reading before by more than 2 cm.

    An ignored reading leaves range and rate as they were. A reading is compared with the raw one before it, not with
    the last accepted one, so that the car follows a wall at a new place from its second reading on.
    """

    def accepts(self, sonar: SonarReading) -> bool:
        """Whether a reading is near the one before."""
        return abs(sonar.range - sonar.previous) <= self.spec.ignore_jump

    def wanted(self, estimate: CarEstimate) -> float:
        """Clearance wanted, m."""
        return self.spec.clearance


class FollowWallRampSpec(WallSpec):
    """Follows a wall with a clearance that changes linearly over a distance, from `start` to `target`."""

    targetable: ClassVar[bool] = True

    type: Literal["FollowWallRamp"] = "FollowWallRamp"
    start: float | None = quantity(None, "m", "clearance at entry; null: the range at entry", gt=0.0, le=5.0)
    target: float = quantity(0.5, "m", "clearance at the end", gt=0.0, le=5.0)
    distance: float = quantity(1.5, "m", "distance over which the clearance changes", gt=0.0, le=100.0)
    before: float = quantity(0.0, "m", "the change ends this far before a point that is handed over", ge=0.0, le=5.0)
    along_wall: bool = Field(
        False,
        description="true: turn a point that is handed over by the car's angle to the wall; false: do not, as in 2016",
    )

    @property
    def finishable(self) -> bool:
        """The state is finished at the end of its distance."""
        return True

    @property
    def readings_needed(self) -> frozenset[str]:
        """The clearance changes with the distance."""
        return super().readings_needed | DISTANCE


class FollowWallRamp(WallState[FollowWallRampSpec]):
    """Wall following with a clearance that is linear in the distance driven. It is finished where the distance ends."""

    finished = False
    entry = 0.0
    """`CarEstimate.distance` at entry, m."""

    def __init__(self, spec: FollowWallRampSpec) -> None:
        super().__init__(spec)
        self.start = self.end_clearance = spec.target
        """Clearance at the beginning and at the end, m."""
        self.length = spec.distance
        """Distance over which it changes, m."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Start from the clearance of the spec, or from the range now."""
        super().on_enter(estimate)
        spec = self.spec
        self.finished = False
        self.entry = estimate.distance
        here = spec.target if self.range is None else self.range
        self.start = here if spec.start is None else spec.start
        self.end_clearance = spec.target
        self.length = spec.distance

    def set_target(self, estimate: CarEstimate, target: Pose, gate: int = NO_GATE) -> None:
        """Ramp to a point.

        Its clearance is start - x_camera at a right wall and start + x_camera at a left one, with x_camera = -y.
        """
        x, y, _ = target
        if self.spec.along_wall:
            x, y = rotate(math.cos(estimate.heading), math.sin(estimate.heading), x, y)
        self.end_clearance = max(self.start - self.sign * y, 0.05)
        self.length = max(x - self.spec.before, 0.05)

    def unreachable(self, estimate: CarEstimate) -> str:
        """Why the clearance cannot change so fast; empty: it can."""
        slope = abs(self.end_clearance - self.start) / self.length
        steepest = math.tan(math.radians(self.spec.max_angle_deg or 90.0))
        return f"a slope of {slope:.2f} is needed, {steepest:.2f} at most" if slope > steepest else ""

    def wanted(self, estimate: CarEstimate) -> float:
        """Clearance wanted now, m."""
        driven = estimate.distance - self.entry
        self.finished = driven >= self.length
        return ramp(self.start, self.end_clearance, self.length, driven)
