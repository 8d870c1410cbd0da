"""Dead reckoning: from the way of the hall sensor and the steering to a pose in `odom`, with its covariance."""

from __future__ import annotations

import math

import numpy as np

from tral_env.arrays import Array
from tral_env.config import HallConfig
from tral_env.geometry import WHEELBASE_M, curvature
from tral_env.randomization import LEVELS
from tral_env.ros import topics
from tral_env.ros.msg.geometry import (
    Point,
    Pose,
    PoseWithCovariance,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
)
from tral_env.ros.msg.sensor import Odometry
from tral_env.ros.msg.std import Header
from tral_env.ros.readings import yaw_quaternion
from tral_env.ros.times import stamp
from tral_env.speed_control import THROTTLE_DEAD

NOT_MEASURED = 1e6
"""Variance of what the car does not measure: height, roll and pitch, and speeds but the forward one. Source: the
configurations of ros2_controllers' diff_drive_controller."""
_CARS, _HALL = LEVELS["default"], HallConfig()
"""How much cars differ, and the hall sensor: the covariance is that of such a car."""


def _variance(spread: tuple[float, float]) -> float:
    """Variance of a number that is drawn uniformly from a range."""
    low, high = spread
    return (high - low) ** 2 / 12.0


_OFFSET = _variance(_CARS.steering_offset_deg) * (math.radians(1.0) / WHEELBASE_M) ** 2
"""Of the curvature that the car drives with straight wheels, 1/m^2."""
_GAIN, _SCALE = _variance(_CARS.lock_scale), _variance(_CARS.wheel_radius_scale)
"""Of the factors on the curvature, and on the way of the hall sensor."""
_TICKS = (max(_CARS.hall_miss_rate) + max(_CARS.hall_double_rate)) * _HALL.metres_per_tick
"""Ticks that are missed or counted twice, each on its own: variance of the way for each metre, m."""
_STEP = _HALL.metres_per_tick**2 / 12.0
"""Of a way that is counted in ticks, m^2."""
_CREEP = (_HALL.metres_per_tick / _HALL.timeout_s) ** 2 / 12.0
"""Of a speed at which no two ticks come within the sensor's time-out, so that it reads 0, (m/s)^2."""
_STAMPS = _HALL.stamp_s**2 / 6.0
"""Of the time between two ticks, whose stamps are rounded, s^2."""


class DeadReckoning:
    """Sums up the way of the car as a bicycle. The hall sensor knows no direction: the throttle tells it.

    The covariance P is that of the errors of x, y, yaw, and of the constants offset b, gain g and scale w. On a way s
    with the curvature k, in the direction a, they grow by
    ``dx = -s sin(a) (dyaw + s (b + k g) / 2) + s cos(a) w``, dy likewise, ``dyaw = s (b + k (g + w))``;
    so ``P = F P F' + q n n'`` with q the variance of the ticks on s and n = (cos a, sin a, k, 0, 0, 0).
    """

    def __init__(self) -> None:
        """Begin at the origin."""
        self.reset()

    def reset(self) -> None:
        """Begin anew at the origin."""
        self.x = self.y = self.yaw = 0.0
        self.speed = self.yaw_rate = 0.0
        self.direction = 1.0
        self._distance: float | None = None
        self._bend, self._is_counted = 0.0, True
        self._P = np.diag([0.0, 0.0, 0.0, _OFFSET, _GAIN, _SCALE])

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
        self._distance, self._is_counted = distance, True
        bend = curvature(steering)
        turn = self.direction * way * bend
        middle = self.yaw + turn / 2
        self.x += self.direction * way * math.cos(middle)
        self.y += self.direction * way * math.sin(middle)
        self.yaw = math.remainder(self.yaw + turn, math.tau)
        self.speed = self.direction * speed
        self.yaw_rate, self._bend = self.speed * bend, bend
        if way:
            self._spread(self.direction * way, middle, bend)

    def lose(self) -> None:
        """No hall sensor counts the way in this tick: the car is wherever it may be, at whatever speed."""
        self.speed = self.yaw_rate = 0.0
        self._is_counted = False

    def transform(self, now_ns: int) -> TransformStamped:
        """The frame base_link in the frame odom."""
        place = Transform(Vector3(self.x, self.y, 0.0), yaw_quaternion(self.yaw))
        return TransformStamped(Header(stamp(now_ns), topics.ODOM), topics.BASE, place)

    def message(self, now_ns: int) -> Odometry:
        """The same as odometry, with the speed."""
        pose = Pose(Point(self.x, self.y, 0.0), yaw_quaternion(self.yaw))
        twist = Twist(Vector3(self.speed), Vector3(0.0, 0.0, self.yaw_rate))
        header = Header(stamp(now_ns), topics.ODOM)
        placed = PoseWithCovariance(pose, self._pose_covariance().ravel().tolist())
        moved = TwistWithCovariance(twist, self._twist_covariance().ravel().tolist())
        return Odometry(header, topics.BASE, placed, moved)

    def _spread(self, way: float, heading: float, bend: float) -> None:
        """Let the covariance grow over a way [m] in a direction [rad] with a curvature [1/m]."""
        cos, sin = math.cos(heading), math.sin(heading)
        F = np.eye(6)
        F[0, 2:] = -way * sin, -way * way / 2 * sin, -way * way / 2 * sin * bend, way * cos
        F[1, 2:] = way * cos, way * way / 2 * cos, way * way / 2 * cos * bend, way * sin
        F[2, 3:] = way, way * bend, way * bend
        n = np.array([cos, sin, bend, 0.0, 0.0, 0.0])
        P = F @ self._P @ F.T + _TICKS * abs(way) * np.outer(n, n)
        self._P = (P + P.T) / 2

    def _pose_covariance(self) -> Array:
        """Of x, y, z, roll, pitch, yaw, (6, 6), m and rad; a way is counted in ticks, too."""
        if not self._is_counted:
            return np.diag([NOT_MEASURED] * 6)
        found = np.diag([0.0, 0.0, *[NOT_MEASURED] * 3, 0.0])
        told = np.ix_([0, 1, 5], [0, 1, 5])
        ahead = np.array([math.cos(self.yaw), math.sin(self.yaw), 0.0])
        found[told] = self._P[:3, :3] + _STEP * np.outer(ahead, ahead)
        return found

    def _twist_covariance(self) -> Array:
        """Of the speeds along and about x, y, z of the car, (6, 6), m/s and rad/s."""
        if not self._is_counted:
            return np.diag([NOT_MEASURED] * 6)
        v, bend = self.speed, self._bend
        spacing = _CREEP if v == 0.0 else (v * v / _HALL.metres_per_tick) ** 2 * _STAMPS
        forward = spacing + _SCALE * v * v
        turning = v * v * (_OFFSET + bend * bend * _GAIN) + bend * bend * forward
        found = np.diag([forward, *[NOT_MEASURED] * 4, turning])
        found[0, 5] = found[5, 0] = bend * forward
        return found
