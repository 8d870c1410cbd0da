"""Dead reckoning: from the way of the hall sensor and the steering to a pose in the frame `odom`."""

from __future__ import annotations

import math

from tral_env.geometry import curvature
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

    def transform(self, now_ns: int) -> TransformStamped:
        """The frame base_link in the frame odom."""
        place = Transform(Vector3(self.x, self.y, 0.0), yaw_quaternion(self.yaw))
        return TransformStamped(Header(stamp(now_ns), topics.ODOM), topics.BASE, place)

    def message(self, now_ns: int) -> Odometry:
        """The same as odometry, with the speed."""
        pose = Pose(Point(self.x, self.y, 0.0), yaw_quaternion(self.yaw))
        twist = Twist(Vector3(self.speed), Vector3(0.0, 0.0, self.yaw_rate))
        header = Header(stamp(now_ns), topics.ODOM)
        return Odometry(header, topics.BASE, PoseWithCovariance(pose), TwistWithCovariance(twist))
