"""From readings to an estimate of the car and its corridor, tick by tick."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tral_env.geometry import MARKER_BOARD_WIDTH_M
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.se2 import clip, compose
from tral_fsm.estimation.detections import MIN_SUPPORT, NOTHING, Agreement, Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.front_obstacle import FrontObstacleTracker
from tral_fsm.estimation.gate_memory import GateMemory
from tral_fsm.estimation.odometry import Odometry
from tral_fsm.estimation.readings import Readings
from tral_fsm.estimation.sonar import Sonar, SonarReading, is_new
from tral_fsm.estimation.wall_filter import MAX_CORRIDOR_ANGLE, Wall, WallFilter

MAX_TRIM = 0.25
"""A larger error is no matter of trim: 5.5 degrees. Source: choice."""
MAX_GAIN_ERROR = 0.2
"""Share of the steering gain that may be the car's error. Source: choice."""
_NEAR_GATE_M, _GATE_ANGLE = 2.0, math.radians(22.0)
"""A gate that is so near stands within this angle of its corridor. Source: the family `gates` has 10 degrees, and as
much for the camera."""
_AXIS_SUPPORT = 5
"""So many images must agree on such a gate. Source: choice, a third of a second at 15 Hz."""
_FRESH_S = 0.5
"""A gate seen so lately is where it was seen from the car, wherever walls say that the car points."""
_WALLS_REACH_M = 2.5
"""Walls that are heard beside the car go on so far, m. Source: choice."""
_WALL_MARGIN_M = 0.25
"""The middle of a gate may lie so far behind a wall, by its range from a side ultrasonic, m. Source: choice: 0.1 m from
the car's middle to an ultrasonic, and the error of a guess."""
_QUARTER = math.pi / 2.0


def less_quarters(angle: float) -> float:
    """An angle less quarter turns, in [-45, 45) degrees, rad."""
    return (angle + _QUARTER / 2.0) % _QUARTER - _QUARTER / 2.0


class Estimator:
    """Estimates of one car.

    The filter of the walls and the tracker of each gate know trim and steering gain by covariances of their own, and
    none is told what another one has corrected, nor where the limits below cut a correction. So each trusts itself
    less than all of them together deserve, and learns a little too fast where walls and gates teach at once.
    """

    def __init__(self) -> None:
        self.tick = 0
        self.odometry = Odometry()
        self.walls = WallFilter()
        self.gates = GateMemory()
        self.steering_offset = 0.0
        """Steering at which the car drives straight, beside what its machine file gives, learnt from both filters."""
        self.steering_gain = 1.0
        """Curvature that the car drives over the one that its steering should give: learnt from walls and gates."""
        self._corridor_yaw = 0.0
        """Direction of the corridor in dead reckoning, rad, but for quarter turns; learnt from the side ranges."""
        self._left, self._front, self._right = Sonar(), Sonar(), Sonar()
        self._front_obstacle = FrontObstacleTracker()
        self._gate_age = self._marker_age = NOTHING.age
        self._gate_agreement, self._marker_agreement = Agreement(), Agreement()
        self._marker = NOTHING
        self._walls_now = self.walls.left.estimate, self.walls.right.estimate, self.walls.sure

    @property
    def _heading(self) -> float:
        """Of the car against the corridor, in [-45, 45) degrees, rad."""
        return less_quarters(self.odometry.yaw - self._corridor_yaw)

    def straight_steering(self, given_trim: float | None) -> float:
        """Steering at which the car drives straight: the trim that its file gives, and the learnt offset."""
        return self.steering_offset + (given_trim or 0.0)

    def update(
        self, row: Sequence[float], given_trim: float | None = None, target: Detection | None = None
    ) -> CarEstimate:
        """Take the readings of a tick.

        Args:
            row: the readings in the order of `Readings`.
            given_trim: steering that the car needs to run straight, as its machine file says; None: 0.
            target: a gate that the machine chose as its target in the tick before; None: no change.

        Returns:
            What is known now.
        """
        readings = Readings._make(row)
        self.tick += 1
        time = self.tick * CONTROL_PERIOD_S
        if target is not None:
            self.gates.target = target
        self.odometry.update(readings, self.straight_steering(given_trim), self.steering_gain)
        if abs(self._heading) > MAX_CORRIDOR_ANGLE:
            self._forget_walls()
        left = self._left.update(readings.ultrasonic_left, readings.ultrasonic_left_age, time)
        front = self._front.update(readings.ultrasonic_front, readings.ultrasonic_front_age, time)
        right = self._right.update(readings.ultrasonic_right, readings.ultrasonic_right_age, time)
        if left.new or right.new:
            self._find_walls(left, right)
        if front.new:
            self._front_obstacle.update(front.range, self.odometry.arc_length)
        self._see(readings, time)
        return self._estimate(readings, time, left, front, right)

    def _estimate(
        self, readings: Readings, time: float, left: SonarReading, front: SonarReading, right: SonarReading
    ) -> CarEstimate:
        """The picture of this tick."""
        odometry, gates = self.odometry, self.gates
        left_wall, right_wall, sure = self._walls_now
        return CarEstimate(
            self.tick,
            time,
            left,
            front,
            right,
            readings.distance,
            readings.speed,
            odometry.x,
            odometry.y,
            odometry.yaw,
            self._heading,
            odometry.arc_length,
            odometry.direction,
            left_wall,
            right_wall,
            sure,
            self._front_obstacle.obstacle,
            gates.nearest,
            gates.guess,
            gates.target,
            gates.was_seen(gates.guess.id),
            self._marker,
            self.steering_offset,
            self.steering_gain,
        )

    def _find_walls(self, left: SonarReading, right: SonarReading) -> None:
        """Correct the corridor's direction and walls by the side ranges that came in this tick."""
        walls = self.walls
        if left.new:
            self._find_wall(walls.left, left.range, self._left.age)
        if right.new:
            self._find_wall(walls.right, right.range, self._right.age)
        self._walls_now = walls.left.estimate, walls.right.estimate, walls.sure

    def _find_wall(self, wall: Wall, range_m: float, age: float) -> None:
        odometry, walls = self.odometry, self.walls
        sample = odometry.sample_before(age)
        if self.gates.beside(sample.x, sample.y):
            return  # a post is no wall
        along = odometry.yaw - self._heading
        turn, trim, gain = walls.update(wall, range_m, sample, along)
        if not walls.direction_known or self.gates.nearest.age <= _FRESH_S:
            self._corridor_yaw -= turn
        elif turn != 0.0:
            # What has drifted is the car's heading: so points that states remember stay where they are.
            odometry.correct_heading(turn, sample.x, sample.y)
            walls.correct_heading(turn)
        self._correct_steering(trim, gain)

    def _correct_steering(self, trim: float, gain: float) -> None:
        """Add what a filter has found to the steering's offset and gain."""
        self.steering_offset = clip(self.steering_offset + trim, MAX_TRIM)
        self.steering_gain = 1.0 + clip(self.steering_gain + gain - 1.0, MAX_GAIN_ERROR)

    def _see(self, readings: Readings, time: float) -> None:
        """Bring what the camera has seen into the frame of dead reckoning; images that disagree change nothing."""
        gates = self.gates
        gate = marker = NOTHING
        gate_age, marker_age = readings.gate_age, readings.marker_age
        if readings.gate_id >= 0.0 and is_new(gate_age, self._gate_age):
            seen = readings.gate_x, readings.gate_y, readings.gate_heading
            gate = self._detection(self._gate_agreement, int(readings.gate_id), seen, gate_age, time)
        if readings.marker_id >= 0.0 and is_new(marker_age, self._marker_age):
            seen = readings.marker_x, readings.marker_y, readings.marker_heading
            marker = self._detection(self._marker_agreement, int(readings.marker_id), seen, marker_age, time)
        self._gate_age, self._marker_age = gate_age, marker_age
        if not (gate.new or marker.new):
            gates.grow_older()
            self._marker = self._marker.older()
            return
        if gate.new:
            self._see_gate(gate)
        elif gates.nearest.id >= 0:
            gates.nearest = gates.nearest.older()
        if marker.new:
            self._marker = marker
        elif self._marker.id >= 0:
            self._marker = self._marker.older()
        if gate.new and marker.new and marker.id // 2 == gate.id:
            half = math.hypot(gate.x - marker.x, gate.y - marker.y)
            gates.measure_opening(2.0 * half - MARKER_BOARD_WIDTH_M)
        if gates.guess_from(self._marker, self.odometry.yaw, self._behind_wall):
            self._follow_axis(gates.guess)
        gates.follow()

    def _detection(
        self, agreement: Agreement, number: int, seen: tuple[float, float, float], age: float, time: float
    ) -> Detection:
        """What a new image shows, placed from where the car was at its exposure; nothing until images agree."""
        sample = self.odometry.sample_before(age)
        placed = Detection(number, *compose((sample.x, sample.y, sample.yaw), seen), age, True)
        judged = agreement.judge(placed, time - age, math.hypot(seen[0], seen[1]))
        return judged if judged.support >= MIN_SUPPORT else NOTHING

    def _behind_wall(self, x: float, y: float) -> bool:
        """Whether a wall that the car hears beside it stands between it and a near place x, y [m]."""
        odometry, (left, right, _) = self.odometry, self._walls_now
        if not self.walls.direction_known or math.hypot(x - odometry.x, y - odometry.y) > _WALLS_REACH_M:
            return False
        along = odometry.yaw - self._heading
        return any(wall.range_from(x, y, along) < -_WALL_MARGIN_M for wall in (left, right))

    def _see_gate(self, seen: Detection) -> None:
        """Let a new detection of a gate correct what earlier ones told of it, and learn offset and gain from it."""
        number = seen.id
        sample = self.odometry.sample_before(seen.age)
        known = self.gates.was_seen(number)
        self._correct_steering(*self.gates.correct(seen, sample, self.walls.trim_sigma))
        if known:  # the axis of the first one alone may be wrong
            self._follow_axis(self.gates.nearest)

    def _follow_axis(self, gate: Detection) -> None:
        """Corridors lead through their gates: a direction that contradicts the axis of a near one was wrong."""
        near = math.hypot(gate.x - self.odometry.x, gate.y - self.odometry.y) < _NEAR_GATE_M
        agreed = gate.support >= _AXIS_SUPPORT
        if near and agreed and abs(less_quarters(gate.heading - self._corridor_yaw)) > _GATE_ANGLE:
            self._corridor_yaw = gate.heading
            self.walls.doubt_direction()
            self._forget_walls()

    def _forget_walls(self) -> None:
        """The car is out of the corridor whose walls it knew, or they were taken for others."""
        walls = self.walls
        walls.forget()
        self._walls_now = walls.left.estimate, walls.right.estimate, walls.sure
