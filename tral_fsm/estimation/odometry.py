"""Dead reckoning: where the hall sensor and the steering put the car, and by how much that may be wrong.

The rear axle's middle drives on a circle: step along it, then turn by step times curvature,

    x' = x + s cos(yaw + s k / 2),  y' = y + s sin(yaw + s k / 2),  yaw' = yaw + s k,    s = d / (1 - k T / 2),

with k the curvature that the wheels give, d the way of the rear left wheel in a tick, T the track, and s the way of the
axle's middle, whose arc is taken for its chord.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from tral_env.geometry import FULL_LOCK, STANDING_MPS, TRACK_M, WHEELBASE_M, curvature, steering_play
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.se2 import Pose, clip, compose, to_outer
from tral_fsm.estimation.readings import Readings

CURVATURE_PER_STEERING = FULL_LOCK / WHEELBASE_M
"""Curvature that a unit of steering gives around straight ahead, 1/m."""
TRIM_SIGMA = 0.08
"""Standard deviation of the trim before anything is known, in units of steering: 1.8 degrees. Source: choice, between
the levels of randomization."""
GAIN_SIGMA = 0.08
"""Standard deviation of the steering gain before anything is known. Source: choice, between the levels of
randomization."""
_HISTORY_TICKS = 128
"""Samples kept for late camera images: 1.6 s."""
_SERVO_LAG_S = 0.06
"""Time constant of the servo. Source: choice."""
_LAG_PER_TICK = CONTROL_PERIOD_S / _SERVO_LAG_S
"""Share of their lag that the wheels make up for in a tick."""
_TRIM_WALK = 0.01
"""Standard deviation by which the trim wanders in a metre."""
_HEADING_WALK = 0.01
"""Standard deviation by which the heading wanders in a metre of straight driving, rad."""
_TICK_ERROR_M = 1e-3
"""Hall ticks that are missed or counted twice while the car turns: their share by the way of one, m. Source: 3 % of
ticks of 26 mm, between the levels of randomization."""
_LAG_ERROR = 0.7
"""Share of what the car turns while its wheels are under way: latency, the servo's speed."""
_LAG_WAY_M = 0.04
"""Over this way that error is the same, m: about that between two readings of an ultrasonic. Source: choice."""
_TRAVEL_ERROR = 0.02
"""The trim may be other after the wheels have moved a unit of steering: friction stops them elsewhere."""
_TRAVEL_TICKS = 5
"""Over so many ticks that error is the same: about those between two readings of an ultrasonic. Source: choice."""


class OdometrySample(NamedTuple):
    """Where the car was when a sensor fired, and how it came there; all by dead reckoning."""

    x: float
    """m."""
    y: float
    """m."""
    yaw: float
    """rad."""
    arc_length: float = 0.0
    """Driven so far, less where it reversed, m."""
    heading_change: float = 0.0
    """Turned by its wheels so far, rad."""
    heading_variance: float = 0.0
    """What the heading may have gone wrong by so far, trim and gain aside, rad^2."""
    trim_variance: float = 0.0
    """What the trim may have changed by so far, in units of steering, squared."""

    def heading_noise(self, other: OdometrySample) -> float:
        """Variance of the heading [rad^2] that the way between two samples adds, trim and gain aside.

        It adds up: the noise of two ways is that of the first and that of the second.
        """
        return abs(self.heading_variance - other.heading_variance)

    def trim_noise(self, other: OdometrySample) -> float:
        """Variance that it adds to the trim."""
        return abs(self.trim_variance - other.trim_variance)


class Odometry:
    """Dead reckoning of one car."""

    __slots__ = (
        "_distance",
        "_frame",
        "_history",
        "_play",
        "_raw",
        "_speed",
        "arc_length",
        "direction",
        "heading_change",
        "heading_variance",
        "trim_variance",
        "wheel",
        "x",
        "y",
        "yaw",
    )

    def __init__(self) -> None:
        self.x = self.y = self.yaw = 0.0
        self.arc_length = self.heading_change = self.heading_variance = self.trim_variance = 0.0
        self.direction = 1.0
        """+1 forward, -1 after reverse gear was ordered at standstill: the hall sensor does not know."""
        self.wheel = 0.0
        """Where the wheels are, in units of steering, trim included."""
        self._distance = self._speed = math.nan
        self._play = 0.0
        """Play of the steering at that speed."""
        self._raw = self._frame = (0.0, 0.0, 0.0)
        """The pose as it adds up, in a frame that is turned when a heading turns out to be wrong."""
        self._history: deque[tuple[Pose, float, float, float, float]] = deque(maxlen=_HISTORY_TICKS)
        """Pose in that frame and sums of `OdometrySample`, tick by tick."""

    def update(self, readings: Readings, offset: float, gain: float) -> None:
        """Move the pose by the way of a tick.

        Args:
            readings: the hall sensor's way and speed, the command as applied.
            offset: steering at which the car drives straight.
            gain: curvature that the car drives over the one that its steering should give.
        """
        speed, distance = readings.speed, readings.distance
        if speed != self._speed:
            self._speed, self._play = speed, steering_play(speed)
        lag = readings.steering - self.wheel
        lag -= clip(lag, self._play)
        if lag != 0.0:
            moved = lag * _LAG_PER_TICK
            self.wheel += moved
            self.trim_variance += _TRAVEL_TICKS * (_TRAVEL_ERROR * moved) ** 2
        step = distance - self._distance
        self._distance = distance
        if speed < STANDING_MPS and readings.throttle != 0.0:
            self.direction = -1.0 if readings.throttle < 0.0 else 1.0
        if step > 0.0:  # also false for NaN, at the first tick
            self._advance(step, lag, gain * curvature(self.wheel - offset))
        self._history.append(
            (self._raw, self.arc_length, self.heading_change, self.heading_variance, self.trim_variance)
        )

    def _advance(self, step: float, lag: float, path_curvature: float) -> None:
        """Move the pose by a way [m] of the hall sensor on a circle of a curvature [1/m]."""
        # The magnets sit on the rear left wheel, which runs on the inner circle of a left turn.
        step = self.direction * step / (1.0 - path_curvature * TRACK_M / 2.0)
        turn = step * path_curvature
        self.arc_length += step
        x, y, yaw = self._raw
        middle = yaw + turn / 2.0
        self._raw = x + step * math.cos(middle), y + step * math.sin(middle), yaw + turn
        self.x, self.y, self.yaw = compose(self._frame, self._raw)
        self.heading_change += turn
        lag_error = _LAG_ERROR * CURVATURE_PER_STEERING * lag
        self.heading_variance += abs(step) * (
            _HEADING_WALK * _HEADING_WALK
            + _TICK_ERROR_M * path_curvature * path_curvature
            + _LAG_WAY_M * lag_error * lag_error
        )
        self.trim_variance += abs(step) * _TRIM_WALK * _TRIM_WALK

    def sample_before(self, age: float) -> OdometrySample:
        """Where the car was some seconds ago, by what is known of its heading now."""
        back = min(int(age / CONTROL_PERIOD_S + 0.5), len(self._history) - 1)
        raw, arc_length, heading_change, heading_variance, trim_variance = self._history[-1 - back]
        x, y, yaw = compose(self._frame, raw)
        return OdometrySample(x, y, yaw, arc_length, heading_change, heading_variance, trim_variance)

    def correct_heading(self, turn: float, x: float, y: float) -> None:
        """The heading was wrong by a turn [rad] when the car was at x, y [m]: turn the whole way about that place."""
        frame_x, frame_y, frame_yaw = self._frame
        frame_x, frame_y = to_outer((x, y, turn), frame_x - x, frame_y - y)
        self._frame = frame_x, frame_y, frame_yaw + turn
        self.x, self.y, self.yaw = compose(self._frame, self._raw)
