"""The blackboard of a machine: what its sensors say, consolidated, and what its states order.

`MachineState.update` takes one row of the observation a tick. Besides the readings themselves it knows which of them
are new, and where the car has driven by hall sensor and steering (dead reckoning).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from tral_env.geometry import MARKER_BOARD_WIDTH_M
from tral_env.interface import (
    CONTROL_PERIOD_S,
    CORE_LAYOUT,
)
from tral_fsm.control.laws import TRACK, clip, curvature, speed_control, steering_play, wrap
from tral_fsm.estimation.front_obstacle import Ahead
from tral_fsm.estimation.gate_memory import Gates
from tral_fsm.estimation.odometry import BEND_PER_STEERING, Stand
from tral_fsm.estimation.sonar import Sighting, Sonar, is_new
from tral_fsm.estimation.wall_filter import SENSOR_X, Walls

_HISTORY_TICKS = 128
"""Poses kept for late camera images: 1.6 s."""
_STEERING_LAG_S = 0.06
"""Time constant of the servo in dead reckoning. Source: choice."""
_TRIM_LIMIT = 0.25
"""A larger fault is no matter of trim: 5.5 degrees. Source: choice."""
_LOCK_LIMIT = 0.2
"""Share of the lock that may be the car's fault. Source: choice."""
_STALL_TICKS, _NEUTRAL_TICKS = 80, 16
"""A car that stands for so long although it should drive gets neutral for so long. Source: choice; 2016's motor
controllers want 100 ms."""
_NEAR_GATE_M, _GATE_ANGLE = 2.0, math.radians(22.0)
"""A gate that is so near stands within this angle of its corridor. Source: the family `gates` has 10 degrees, and as
much for the camera."""
_FRESH_S = 0.5
"""A gate seen so lately is where it was seen from the car, wherever walls say that the car points."""
_QUARTER = math.pi / 2.0

COLUMNS = CORE_LAYOUT.names
"""Readings a machine sees, in the order of the observation."""


def _quarter(angle: float) -> float:
    """An angle less quarter turns, in [-45, 45) degrees, rad."""
    return (angle + _QUARTER / 2.0) % _QUARTER - _QUARTER / 2.0


Pose = tuple[float, float, float]
"""x forward [m], y left [m], heading [rad]."""


class MachineState:
    """Readings, dead reckoning and outputs of one car."""

    __slots__ = (
        "_history",
        "_integral",
        "_stalled",
        "_travelled",
        "_wheel",
        "ahead",
        "applied_steering",
        "applied_throttle",
        "corridor_yaw",
        "direction",
        "distance",
        "front",
        "gate",
        "gates",
        "given_trim",
        "guessed_gate",
        "late",
        "left",
        "lock_fault",
        "lock_scale",
        "marker",
        "path",
        "right",
        "speed",
        "speed_target",
        "steering",
        "swept",
        "throttle",
        "tick",
        "time",
        "trim",
        "trim_fault",
        "turned",
        "walls",
        "wanted_clearance",
        "wanted_side",
        "wound",
        "x",
        "y",
        "yaw",
    )

    def __init__(self) -> None:
        self.tick = 0
        """Ticks since reset."""
        self.time = 0.0
        """s since reset."""
        self.left = Sonar("left")
        self.front = Sonar("front")
        self.right = Sonar("right")
        self.distance = 0.0
        """Driven, by the hall sensor, m."""
        self.speed = 0.0
        """By the hall sensor, m/s."""
        self.gates = Gates()
        """Those that were seen."""
        self.gate = self.gates.nearest
        self.guessed_gate = self.gates.guess
        self.marker = Sighting()
        self.applied_steering = 0.0
        """Last command, as applied."""
        self.applied_throttle = 0.0
        """Last command, as applied."""
        self.x = 0.0
        """Dead reckoning from the start, m."""
        self.y = 0.0
        """Dead reckoning from the start, m."""
        self.yaw = 0.0
        """Dead reckoning from the start, rad, not wrapped."""
        self.swept = 0.0
        """How far the wheels have been moved, to and fro, in units of steering."""
        self.path = 0.0
        """Dead reckoning's length, less where the car reverses, m."""
        self.turned = 0.0
        """By its wheels, rad."""
        self.wound = 0.0
        """Square of the curvature, added up over the way, rad^2/m: hall ticks that are missed turn the car by it."""
        self.late = 0.0
        """How far the car turned while its wheels were under way, rad, added up: when they arrive is not known well."""
        self.corridor_yaw = 0.0
        """Direction of the corridor in dead reckoning, rad, but for quarter turns; learnt from the side ranges."""
        self.walls = Walls()
        """The corridor's walls."""
        self.ahead = Ahead()
        """What is ahead."""
        self.direction = 1.0
        """+1 forward, -1 after reverse gear was ordered at standstill: the hall sensor does not know."""
        self.trim = 0.0
        """Steering at which the car drives straight, as far as the states have learnt it."""
        self.given_trim = 0.0
        """Steering at which the car drives straight, as far as the active state's parameters say so."""
        self.lock_scale = 1.0
        """Curvature that the car drives over the one that its steering should give, as far as gates have taught it."""
        self.lock_fault = 0.0
        """By how much the walls say that it is wrong: dead reckoning allows for it."""
        self.trim_fault = 0.0
        """By how much the walls say that it is wrong: dead reckoning allows for it, a state that learns takes it."""
        self.steering = 0.0
        """Output, + = left."""
        self.throttle = 0.0
        """Output."""
        self.wanted_side = math.nan
        """Wall that the active state keeps a clearance to: +1 left, -1 right, NaN none."""
        self.wanted_clearance = math.nan
        """That clearance, side ultrasonic to wall, m."""
        self.speed_target = math.nan
        """Speed that the active state regulates, m/s; NaN: open loop."""
        self._integral = 0.0
        self._stalled = 0
        self._wheel = 0.0
        self._travelled = math.nan
        self._history: deque[Pose] = deque(maxlen=_HISTORY_TICKS)

    def update(self, row: Sequence[float]) -> None:
        """Take one row of the observation.

        Args:
            row: the readings in the order of `COLUMNS`.
        """
        (
            range_left, range_front, range_right, age_left, age_front, age_right,
            self.distance, self.speed,
            gate_id, gate_x, gate_y, gate_heading, gate_age,
            marker_id, marker_x, marker_y, marker_heading, marker_age,
            self.applied_steering, self.applied_throttle,
        ) = row  # fmt: skip
        self.tick += 1
        self.time = time = self.tick * CONTROL_PERIOD_S
        self._reckon()
        self.left.update(range_left, age_left, time)
        self.front.update(range_front, age_front, time)
        self.right.update(range_right, age_right, time)
        self._find_walls()
        self._see(self.gate, gate_id, gate_x, gate_y, gate_heading, gate_age)
        self._see(self.marker, marker_id, marker_x, marker_y, marker_heading, marker_age)
        if self.gate.new and self.marker.new and self.marker.id // 2 == self.gate.id:
            self.gates.measure(2.0 * math.hypot(gate_x - marker_x, gate_y - marker_y) - MARKER_BOARD_WIDTH_M)
        if self.gates.look(self.marker, self.yaw):
            self._follow_axis(self.guessed_gate)
        self.gates.follow()
        self.wanted_side = self.wanted_clearance = self.speed_target = math.nan

    def _reckon(self) -> None:
        """Move the pose by what the hall sensor counted, on the circle that the steering gives."""
        behind = self.applied_steering - self._wheel
        behind -= clip(behind, steering_play(self.speed))
        moved = behind * (CONTROL_PERIOD_S / _STEERING_LAG_S)
        self._wheel += moved
        self.swept += abs(moved)
        step = self.distance - self._travelled
        self._travelled = self.distance
        if self.speed < 0.05 and self.applied_throttle != 0.0:
            self.direction = -1.0 if self.applied_throttle < 0.0 else 1.0
        if step > 0.0:  # also false for NaN, at the first tick
            wheel = self._wheel - self.trim - self.trim_fault - self.given_trim
            bend = (self.lock_scale + self.lock_fault) * curvature(wheel)
            # the magnets sit on the rear left wheel, which runs on the inner circle of a left turn
            step = self.direction * step / (1.0 - bend * TRACK / 2.0)
            self.path += step
            self.late += BEND_PER_STEERING * abs(behind * step)
            middle = self.yaw + step * bend / 2.0
            self.x += step * math.cos(middle)
            self.y += step * math.sin(middle)
            self.yaw += step * bend
            self.turned += step * bend
            self.wound += abs(step) * bend * bend
        self._history.append((self.x, self.y, self.yaw))

    def _see(self, seen: Sighting, number: float, x: float, y: float, heading: float, age: float) -> None:
        """Bring a sighting into the frame of dead reckoning, with the pose at which its image was exposed."""
        seen.new = number >= 0.0 and is_new(age, seen.age)
        seen.age = age
        if not seen.new:
            return
        px, py, yaw = self._pose_before(age)
        cos, sin = math.cos(yaw), math.sin(yaw)
        seen.id = int(number)
        seen.x = px + cos * x - sin * y
        seen.y = py + sin * x + cos * y
        seen.heading = yaw + heading
        if seen is self.gate:
            self._track(self._stand(px, py, yaw))

    def _track(self, stand: Stand) -> None:
        """Let the new sighting of a gate correct what earlier ones told of it, and learn trim and lock from it."""
        known = self.gates.was_seen(self.gate.id)
        trim, lock = self.gates.correct(stand, self.walls.trim_deviation)
        self.set_trim(self.trim + trim)
        self.lock_scale = 1.0 + clip(self.lock_scale + lock - 1.0, _LOCK_LIMIT)
        if known:  # one sighting alone may be wrong
            self._follow_axis(self.gate)

    def _follow_axis(self, gate: Sighting) -> None:
        """Corridors lead through their gates: a direction that contradicts the axis of a near one was wrong."""
        near = math.hypot(gate.x - self.x, gate.y - self.y) < _NEAR_GATE_M
        if near and abs(_quarter(gate.heading - self.corridor_yaw)) > _GATE_ANGLE:
            self.corridor_yaw = gate.heading
            self.walls.forget()
            self.walls.doubt_direction()

    def _stand(self, x: float, y: float, yaw: float) -> Stand:
        """Where the car was a moment ago."""
        return Stand(x, y, yaw, self.path, self.turned, self.wound, self.late, self.swept)

    def _pose_before(self, age: float) -> Pose:
        """Pose of dead reckoning some seconds ago."""
        back = min(int(age / CONTROL_PERIOD_S + 0.5), len(self._history) - 1)
        return self._history[-1 - back]

    def _find_walls(self) -> None:
        """Correct the corridor's direction and walls by the side ranges that came in this tick."""
        for sonar, wall in ((self.left, self.walls.left), (self.right, self.walls.right)):
            if sonar.new:
                x, y, yaw = self._pose_before(sonar.age)
                if self.gates.beside(x, y):
                    continue  # a post is no wall
                along = self.yaw - self.heading
                turn, trim, lock = self.walls.take(wall, sonar.range, self._stand(x, y, yaw), along)
                if self.walls.direction_known and self.gate.age > _FRESH_S:
                    # What has drifted is the car's heading: so points that states remember stay where they are.
                    self.yaw += turn
                else:
                    self.corridor_yaw -= turn
                lock_off = self.lock_scale - 1.0
                self.lock_fault = clip(lock_off + self.lock_fault + lock, _LOCK_LIMIT) - lock_off
                self.trim_fault = clip(self.trim + self.trim_fault + trim, _TRIM_LIMIT) - self.trim
        if self.front.new:
            self.ahead.take(self.front.range, self.distance, self.path)

    def clearance(self, is_left: bool, ahead: float = 0.0) -> float:
        """What the side ultrasonic should read now, or so far `ahead` on the way straight on, m; NaN: no wall known."""
        wall = self.walls.left if is_left else self.walls.right
        if wall.range != wall.range:
            return math.nan
        along = self.yaw - self.heading
        reach = SENSOR_X + ahead
        return wall.seen_from(self.x + reach * math.cos(self.yaw), self.y + reach * math.sin(self.yaw), along)

    def side(self, is_left: bool) -> Sonar:
        """Side ultrasonic of that side."""
        return self.left if is_left else self.right

    def from_here(self, x: float, y: float, heading: float) -> Pose:
        """A pose of dead reckoning, as seen from the car now: x forward, y left, heading wrapped."""
        dx, dy = x - self.x, y - self.y
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return cos * dx + sin * dy, cos * dy - sin * dx, wrap(heading - self.yaw)

    def distance_to(self, seen: Sighting) -> float:
        """From the car to what was seen, m."""
        return math.hypot(seen.x - self.x, seen.y - self.y)

    def to_reckoning(self, x: float, y: float, heading: float) -> Pose:
        """A pose seen from the car now, in the frame of dead reckoning."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return self.x + cos * x - sin * y, self.y + sin * x + cos * y, self.yaw + heading

    @property
    def heading(self) -> float:
        """Heading of the car against the corridor, in [-45, 45) degrees, rad: corridors meet at right angles."""
        return _quarter(self.yaw - self.corridor_yaw)

    def learn_trim(self, gain: float, error: float) -> None:
        """Integrate a small deviation [m], + = too far right, with a gain [1/(m s)] into the trim."""
        self.set_trim(self.trim + gain * error * CONTROL_PERIOD_S)

    def take_trim(self) -> None:
        """Steer from now on by what the walls have told of the trim."""
        self.trim += self.trim_fault
        self.trim_fault = 0.0

    def set_trim(self, trim: float) -> None:
        """Set the trim, within what may be the car's fault."""
        self.trim = clip(trim, _TRIM_LIMIT)

    def regulate(self, speed: float) -> None:
        """Set the throttle that brings the car to a speed [m/s]."""
        self.speed_target = speed
        self.throttle, self._integral = speed_control(speed, self.speed, self._integral)
        self._release(self.throttle)

    def push(self, throttle: float) -> None:
        """Set the throttle itself, open loop."""
        self.throttle = throttle
        if throttle < 0.0:
            self._release(throttle)

    def _release(self, throttle: float) -> None:
        """Neutral for a while when the car stands although it is told to drive.

        To turn its direction the motor controller wants to see brake, then neutral; until then it brakes.
        """
        self._stalled = self._stalled + 1 if self.speed < 0.05 and throttle != 0.0 else 0
        if self._stalled > _STALL_TICKS:
            self.throttle = self._integral = 0.0
        if self._stalled >= _STALL_TICKS + _NEUTRAL_TICKS:
            self._stalled = 0

    def want_clearance(self, is_left: bool, clearance: float) -> None:
        """Say which clearance [m] to which wall the active state keeps."""
        self.wanted_side = 1.0 if is_left else -1.0
        self.wanted_clearance = clearance
