"""Dead reckoning: from the way of the hall sensor and the steering to a pose in the frame `odom`."""

from __future__ import annotations

import math

from tral_env.geometry import curvature
from tral_env.speed_control import THROTTLE_DEAD


class DeadReckoning:
    """Sums up the way of the car as a bicycle. The hall sensor knows no direction: the throttle tells it."""

    def __init__(self) -> None:
        """Begin at the origin."""
        self.reset()

    def reset(self) -> None:
        """Begin anew at the origin."""
        self.x = self.y = self.yaw = 0.0
        self.speed = self.yaw_rate = 0.0
        self.direction = 1.0
        self._distance: float | None = None
        self._standing = True

    def update(self, distance: float, speed: float, steering: float, throttle: float) -> None:
        """Take the readings of a tick.

        Args:
            distance: way of the hall sensor, m.
            speed: from the hall sensor, m/s.
            steering: command as applied, [-1, 1].
            throttle: command as applied, [-1, 1].
        """
        # A car that rolls keeps its direction; a throttle against it brakes.
        if speed == 0.0 and abs(throttle) > THROTTLE_DEAD:
            self.direction = math.copysign(1.0, throttle)
        way = 0.0 if self._distance is None or distance < self._distance else distance - self._distance
        self._distance = distance
        bend = curvature(steering)
        turn = self.direction * way * bend
        middle = self.yaw + turn / 2
        self.x += self.direction * way * math.cos(middle)
        self.y += self.direction * way * math.sin(middle)
        self.yaw = math.remainder(self.yaw + turn, math.tau)
        self.speed = self.direction * speed
        self.yaw_rate = self.speed * bend
