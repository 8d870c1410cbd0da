"""What a machine knows of its car and corridor in one tick: the one thing that states and conditions are given."""

from __future__ import annotations

import math
from typing import NamedTuple

from tral_env.geometry import SIDE_SONAR_X_M
from tral_env.se2 import Pose, compose, relative
from tral_fsm.estimation.detections import NOTHING, Detection
from tral_fsm.estimation.front_obstacle import FrontObstacle
from tral_fsm.estimation.sonar import SonarReading
from tral_fsm.estimation.wall_filter import WallEstimate


class CarEstimate(NamedTuple):
    """An immutable picture of one tick. Frame: dead reckoning from the start, x forward, y left, SI units."""

    tick: int = 0
    """Ticks since reset."""
    time: float = 0.0
    """s since reset."""
    left: SonarReading = SonarReading()
    """Left ultrasonic."""
    front: SonarReading = SonarReading()
    """Front ultrasonic."""
    right: SonarReading = SonarReading()
    """Right ultrasonic."""
    distance: float = 0.0
    """Driven, by the hall sensor, which knows no direction, m."""
    speed: float = 0.0
    """By the hall sensor, without sign, m/s."""
    x: float = 0.0
    """m."""
    y: float = 0.0
    """m."""
    yaw: float = 0.0
    """rad, not wrapped."""
    heading: float = 0.0
    """Of the car against the corridor, in [-45, 45) degrees, rad: corridors meet at right angles."""
    arc_length: float = 0.0
    """Driven, less where the car reversed, m."""
    direction: float = 1.0
    """+1 forward, -1 after reverse gear was ordered at standstill."""
    left_wall: WallEstimate = WallEstimate(1.0)
    """The corridor's left wall."""
    right_wall: WallEstimate = WallEstimate(-1.0)
    """The corridor's right wall."""
    sure: bool = False
    """The corridor's direction is known, and at which steering the car drives straight."""
    obstacle: FrontObstacle = FrontObstacle()
    """What is ahead."""
    gate: Detection = NOTHING
    """The nearest gate of the last image that showed one whole."""
    guessed_gate: Detection = NOTHING
    """A gate of which one marker is in view alone."""
    target_gate: Detection = NOTHING
    """The gate that was handed over to a state last."""
    gate_seen_whole: bool = False
    """The guessed gate was seen with both of its markers before."""
    marker: Detection = NOTHING
    """The nearest marker of the last image that showed one."""
    steering_offset: float = 0.0
    """Steering at which the car drives straight, beside what its machine file gives, as far as it has been learnt."""
    steering_gain: float = 1.0
    """Curvature that the car drives over the one that its steering should give, as far as it has been learnt."""

    @property
    def pose(self) -> Pose:
        """x [m], y [m], yaw [rad]."""
        return self.x, self.y, self.yaw

    @property
    def along(self) -> float:
        """Direction of the corridor, rad."""
        return self.yaw - self.heading

    def sonar(self, is_left: bool) -> SonarReading:
        """Side ultrasonic of a side."""
        return self.left if is_left else self.right

    def wall(self, is_left: bool) -> WallEstimate:
        """Wall on a side."""
        return self.left_wall if is_left else self.right_wall

    def clearances(self, ahead: float = 0.0) -> tuple[float, float]:
        """What the left and the right ultrasonic should read now, or so far `ahead` on the way straight on, m.

        NaN where no wall is known.
        """
        yaw, along, reach = self.yaw, self.yaw - self.heading, SIDE_SONAR_X_M + ahead
        x, y = self.x + reach * math.cos(yaw), self.y + reach * math.sin(yaw)
        return self.left_wall.range_from(x, y, along), self.right_wall.range_from(x, y, along)

    def from_here(self, pose: Pose) -> Pose:
        """A pose of dead reckoning as seen from the car: x forward, y left, heading wrapped."""
        return relative((self.x, self.y, self.yaw), pose)

    def to_reckoning(self, pose: Pose) -> Pose:
        """A pose as seen from the car, in the frame of dead reckoning."""
        return compose((self.x, self.y, self.yaw), pose)

    def seen_from_here(self, detection: Detection) -> Pose:
        """Where something that was seen is, as seen from the car."""
        return relative((self.x, self.y, self.yaw), (detection.x, detection.y, detection.heading))

    def distance_to(self, detection: Detection) -> float:
        """From the car to what was seen, m."""
        return math.hypot(detection.x - self.x, detection.y - self.y)
