"""From a wanted speed to a throttle: feed-forward and PI on the hall sensor's speed, and the way out of a stall.

Machines, environments and learned policies regulate with this law.
"""

from __future__ import annotations

from tral_env.geometry import STANDING_MPS
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.se2 import clip

MIN_BRAKING_MPS = 0.15
"""A slower car is not braked by the regulator, m/s: at standstill that would be reverse gear. Source: choice, one and a
half times the hall sensor's slowest reading."""
THROTTLE_DEAD = 0.1
"""Throttle at which the car begins to roll. Source: line through the level/speed table of the same cars."""
SPEED_PER_THROTTLE = 2.64
"""m/s for a unit of throttle above that. Source: as above."""
SPEED_P = 0.15
"""Throttle for a speed error of 1 m/s. Source: choice."""
SPEED_I = 0.25
"""Throttle a second for a speed error of 1 m/s, which weight and battery cause. Source: choice."""
SPEED_I_LIMIT = 0.25
"""The integral adds at most this much throttle. Source: choice."""
STALL_TICKS = 80
"""A car that stands for so long although it should drive gets neutral. Source: choice."""
NEUTRAL_TICKS = 16
"""It gets neutral for so long. Source: choice; the motor controllers of 2016 want 100 ms."""


def feed_forward(speed: float) -> float:
    """Throttle that holds a speed [m/s] on the level: 0.1 + v / 2.64; 0 at 0."""
    return THROTTLE_DEAD + speed / SPEED_PER_THROTTLE if speed > 0.0 else 0.0


def speed_control(wanted: float, speed: float, integral: float) -> tuple[float, float]:
    """Feed-forward and PI on the speed of the hall sensor; one tick.

    Args:
        wanted: m/s, not negative.
        speed: from the hall sensor, m/s.
        integral: of the tick before, throttle.

    Returns:
        Throttle in [-1, 1] and the new integral. A standing car is never given negative throttle, which would be
        reverse gear. At a wanted speed of 0 the car is never given positive throttle, and once it stands, what was
        summed up is forgotten.
    """
    error = wanted - speed
    integral = clip(integral + SPEED_I * error * CONTROL_PERIOD_S, SPEED_I_LIMIT)
    throttle = clip(feed_forward(wanted) + SPEED_P * error + integral)
    if speed < MIN_BRAKING_MPS:
        throttle = max(throttle, 0.0)
    if wanted > 0.0:
        return throttle, integral
    return min(throttle, 0.0), 0.0 if speed < STANDING_MPS else integral


class SpeedRegulator:
    """Makes the throttle of one car from the speed that is wanted of it, tick by tick."""

    __slots__ = ("_integral", "_stalled_ticks")

    def __init__(self) -> None:
        self._integral = 0.0
        self._stalled_ticks = 0

    def regulate(self, wanted: float, speed: float) -> float:
        """Throttle that brings the car to a speed.

        Args:
            wanted: m/s, not negative.
            speed: from the hall sensor, m/s.
        """
        throttle, self._integral = speed_control(wanted, speed, self._integral)
        return self._released(throttle, speed)

    def drive(self, wanted: float, speed: float) -> float:
        """Throttle for a speed; one below 0 is not regulated, since the hall sensor knows no direction.

        Args:
            wanted: m/s, + = forward.
            speed: from the hall sensor, m/s.
        """
        return self.reverse(wanted / SPEED_PER_THROTTLE, speed) if wanted < 0.0 else self.regulate(wanted, speed)

    def reverse(self, throttle: float, speed: float) -> float:
        """A throttle below 0, without regulation; what was summed up is forgotten."""
        self._integral = 0.0
        return self._released(clip(throttle), speed)

    def pass_on(self, throttle: float) -> float:
        """A throttle as it is; all that was summed up is forgotten."""
        self._integral = 0.0
        self._stalled_ticks = 0
        return clip(throttle)

    def _released(self, throttle: float, speed: float) -> float:
        """Neutral for a while when the car stands although it is told to drive.

        To turn its direction the motor controller wants to see brake, then neutral; until then it brakes.
        """
        self._stalled_ticks = self._stalled_ticks + 1 if speed < STANDING_MPS and throttle != 0.0 else 0
        if self._stalled_ticks > STALL_TICKS:
            throttle = self._integral = 0.0
        if self._stalled_ticks >= STALL_TICKS + NEUTRAL_TICKS:
            self._stalled_ticks = 0
        return throttle
