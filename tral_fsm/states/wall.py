"""Wall following: the law of 2016, and states that differ in the clearance they want and the readings they believe."""

from __future__ import annotations

import math
from typing import TypeVar

from tral_env.se2 import Pose
from tral_fsm.control.command import Command
from tral_fsm.control.laws import clip, damping, pid, pid_rate, ramp, slowed, steering_for
from tral_fsm.definition.machine import BasicFollowWallSpec, FollowWallRampSpec, FollowWallSpec, WallSpec
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.sonar import SonarReading
from tral_fsm.states.base import NO_GATE, DrivingState

W = TypeVar("W", bound=WallSpec)

_HOLD_LENGTH = 0.4
"""Length in which the car turns back to the corridor's direction when its wall is lost, m. Source: choice."""


class WallState(DrivingState[W]):
    """Wall following; what the clearance is and which readings are believed, is left to the states below.

    + steering = left, so that the law's y is steering at a left wall and its negative at a right one. With no echo on
    the followed side, or one beyond `reach`, the car turns back to the corridor's direction and holds it.
    """

    def __init__(self, spec: W) -> None:
        super().__init__(spec)
        self.is_left = spec.side == "left"
        self.sign = 1.0 if self.is_left else -1.0
        self.limit = math.inf if spec.max_error is None else spec.max_error
        self.steepest: float | None = None
        """Sine of the angle to the wall at which p e and d e' shall be in balance at most; None: any."""
        if spec.max_angle_deg is not None and spec.derivative == "sonar" and spec.p > 0.0 and spec.d != 0.0:
            self.steepest = math.sin(math.radians(spec.max_angle_deg))
        self.range: float | None = None
        """Accepted range of the followed wall, m; None: no wall."""
        self.rate = 0.0
        """Its change, m/s, over the sonar's last interval."""
        self.error_sum = 0.0
        self.error_old: float | None = None

    def on_enter(self, estimate: CarEstimate) -> None:
        """Begin with what the sonar reads now; e - eold and esum are 0."""
        self.rate = self.error_sum = 0.0
        self.error_old = None
        sonar = estimate.sonar(self.is_left)
        self.range = sonar.range if sonar.range <= self.spec.reach else None

    def tick(self, estimate: CarEstimate) -> Command:
        """One tick of the control law."""
        spec = self.spec
        sonar = estimate.left if self.is_left else estimate.right
        if sonar.new:
            self.take(sonar)
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
        """The e that counts at most, m."""
        if self.steepest is None:
            return self.limit
        return min(self.limit, self.steepest * d * max(speed, 0.2) / self.spec.p)

    def accepts(self, sonar: SonarReading) -> bool:
        """Whether a new reading is to be believed."""
        return True

    def wanted(self, estimate: CarEstimate) -> float:
        """Clearance wanted now, m."""
        raise NotImplementedError

    def take(self, sonar: SonarReading) -> None:
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
        """Speed before something ahead, m/s; None: as it is."""
        spec = self.spec
        return slowed(spec.speed, spec.slow_speed, spec.slow_front, estimate.front.range)


def hold_course(estimate: CarEstimate) -> float:
    """Steering that turns the car back to the corridor's direction and keeps it there."""
    return steering_for(-2.0 / _HOLD_LENGTH * math.sin(estimate.heading))


class BasicFollowWall(WallState[BasicFollowWallSpec]):
    """Wall following that believes every reading."""

    def wanted(self, estimate: CarEstimate) -> float:
        """Clearance wanted, m."""
        return self.spec.clearance


class FollowWall(WallState[FollowWallSpec]):
    """Wall following that ignores readings which differ from the reading before by more than 2 cm.

    An ignored reading leaves range and rate as they were. The comparison is with the previous raw reading, not with
    the last accepted one: so a wall that has moved for good is followed from its second reading on.
    """

    def accepts(self, sonar: SonarReading) -> bool:
        """Whether a reading is near the one before."""
        return abs(sonar.range - sonar.previous) <= self.spec.ignore_jump

    def wanted(self, estimate: CarEstimate) -> float:
        """Clearance wanted, m."""
        return self.spec.clearance


class FollowWallRamp(WallState[FollowWallRampSpec]):
    """Wall following with a clearance linear in the distance driven. Finished at the end of the distance."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Start from the spec's clearances, or from the range now."""
        super().on_enter(estimate)
        spec = self.spec
        self.finished = False
        self.entry = estimate.distance
        here = spec.target if self.range is None else self.range
        self.start = here if spec.start is None else spec.start
        self.target = spec.target
        self.length = spec.distance

    def set_target(self, estimate: CarEstimate, target: Pose, gate: int = NO_GATE) -> None:
        """Ramp to a point: its clearance is start - x_camera at a right wall, + at a left one; x_camera = -y."""
        x, y, _ = target
        if self.spec.along_wall:
            cos, sin = math.cos(estimate.heading), math.sin(estimate.heading)
            x, y = cos * x - sin * y, sin * x + cos * y
        self.target = max(self.start - self.sign * y, 0.05)
        self.length = max(x - self.spec.before, 0.05)

    def unreachable(self, estimate: CarEstimate) -> str:
        """Why the clearance cannot change so fast."""
        slope = abs(self.target - self.start) / self.length
        steepest = math.tan(math.radians(self.spec.max_angle_deg or 90.0))
        return f"a slope of {slope:.2f} is needed, {steepest:.2f} at most" if slope > steepest else ""

    def wanted(self, estimate: CarEstimate) -> float:
        """Clearance wanted now, m."""
        driven = estimate.distance - self.entry
        self.finished = driven >= self.length
        return ramp(self.start, self.target, self.length, driven)
