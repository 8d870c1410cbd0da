"""What states do. Each class runs one spec of `definition`; `tick` writes steering and throttle to the blackboard.

A state of your own: derive a spec from `definition.StateSpec`, a class from `State`, decorate it with `runs`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

from tral_fsm.arcs import out_of_reach
from tral_fsm.control import clip, curvature, line, pid, pid_rate, pursuit, ramp, slowed, steering_for
from tral_fsm.definition import (
    STATES,
    ApproachPointSpec,
    ArucoGateCenterSpec,
    BasicFollowWallSpec,
    DrivingSpec,
    FollowWallRampSpec,
    FollowWallSpec,
    IdleSpec,
    MotorSpec,
    StateSpec,
    StopSpec,
    WallSpec,
    type_name,
)
from tral_fsm.machine_state import MachineState, Pose, Sonar

S = TypeVar("S", bound=StateSpec)
W = TypeVar("W", bound=WallSpec)
D = TypeVar("D", bound=DrivingSpec)

_HOLD_LENGTH = 0.4
"""Length in which the car turns back to the corridor's direction when its wall is lost, m. Source: choice."""
_TRIM_ERROR, _TRIM_HEADING = 0.12, math.radians(6.0)
"""The trim is learnt within this deviation [m] and heading [rad] alone: elsewhere e is not the car's fault."""
NO_GATE = -1
"""Id of a target that is no gate."""


@runtime_checkable
class Finishable(Protocol):
    """A state that can say that it is finished."""

    @property
    def finished(self) -> bool:
        """Its work is done."""
        ...


@runtime_checkable
class Targetable(Protocol):
    """A state that can be handed a target point at run time."""

    def set_target(self, m: MachineState, x: float, y: float, heading: float, gate: int = NO_GATE) -> None:
        """Take a target, right after entry.

        Args:
            m: the blackboard.
            x: ahead of the car now, m.
            y: left of the car now, m.
            heading: direction in which it is to be passed, against the car, rad.
            gate: id of the gate that it is, or -1.
        """
        ...


class State(Generic[S]):
    """Base of all running states."""

    def __init__(self, spec: S) -> None:
        self.spec = spec

    def on_enter(self, m: MachineState) -> None:
        """Called when the state becomes active."""

    def tick(self, m: MachineState) -> None:
        """Compute the output: write `m.steering` and `m.throttle`."""

    def on_exit(self, m: MachineState) -> None:
        """Called when the state is left."""

    def unreachable(self, m: MachineState) -> str:
        """Why a targetable state cannot come to its target any more; empty: it can."""
        return ""


RUNTIMES: dict[str, type[State[Any]]] = {}
"""The class that runs each type of state."""

R = TypeVar("R", bound=type[State[Any]])


def runs(spec: type[StateSpec]) -> Callable[[R], R]:
    """Class decorator: this class runs states of that spec, which machine files may name from now on."""

    def register(runtime: R) -> R:
        STATES[type_name(spec)] = spec
        RUNTIMES[type_name(spec)] = runtime
        return runtime

    return register


class DrivingState(State[D]):
    """A state that moves the car."""

    def steer(self, m: MachineState, steering: float) -> None:
        """Set the steering, with the trims of the spec and of what was learnt."""
        m.steering = clip(steering + self.spec.steering_trim + m.trim)

    def drive(self, m: MachineState, speed: float | None = None) -> None:
        """Set the throttle: open loop, or regulated to the spec's speed or to the one given [m/s]."""
        spec = self.spec
        if spec.throttle is not None:
            m.push(spec.throttle)
        elif spec.speed is not None:
            m.regulate(spec.speed if speed is None else speed)


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
        self.steep = math.inf
        """e at which p e and d e' are in balance at `max_angle_deg`, m for 1 m/s."""
        if spec.max_angle_deg is not None and spec.derivative == "sonar" and spec.p * spec.d > 0.0:
            self.steep = math.sin(math.radians(spec.max_angle_deg)) * spec.d / spec.p
        self.range: float | None = None
        """Accepted range of the followed wall, m; None: no wall."""
        self.rate = 0.0
        """Its change, m/s, over the sonar's last interval."""
        self.error_sum = 0.0
        self.error_old: float | None = None

    def on_enter(self, m: MachineState) -> None:
        """Begin with what the sonar reads now; e - eold and esum are 0."""
        self.rate = self.error_sum = 0.0
        self.error_old = None
        sonar = m.side(self.is_left)
        self.range = sonar.range if sonar.range <= self.spec.reach else None

    def tick(self, m: MachineState) -> None:
        """One tick of the control law."""
        spec = self.spec
        sonar = m.left if self.is_left else m.right
        if sonar.new:
            self.take(m, sonar)
        wanted = self.wanted(m)
        if self.range is None:
            y = self.sign * hold_course(m)
            self.error_old = None
        else:
            if spec.at_most_half:
                wanted = min(wanted, self.half(m))
            error = clip(self.range - wanted, min(self.limit, self.steep * max(m.speed, 0.2)))
            self.error_sum += error
            if spec.derivative == "tick":
                y = pid(
                    spec.p, spec.i, spec.d, error, self.error_sum, error if self.error_old is None else self.error_old
                )
            else:
                y = pid_rate(spec.p, spec.i, spec.d, error, self.error_sum, self.rate)
            self.error_old = error
            if spec.learn_trim and abs(error) < _TRIM_ERROR and abs(m.heading) < _TRIM_HEADING:
                m.learn_trim(spec.learn_trim, self.sign * error)
        self.steer(m, self.sign * y)
        m.want_clearance(self.is_left, wanted)
        self.drive(m, self.speed_now(m))

    def accepts(self, sonar: Sonar) -> bool:
        """Whether a new reading is to be believed."""
        return True

    def wanted(self, m: MachineState) -> float:
        """Clearance wanted now, m."""
        raise NotImplementedError

    def take(self, m: MachineState, sonar: Sonar) -> None:
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

    def half(self, m: MachineState) -> float:
        """Half of the free width beside the car, m."""
        other = (m.right if self.is_left else m.left).range
        mine = self.range
        return math.inf if mine is None or other > self.spec.reach else (mine + other) / 2.0

    def speed_now(self, m: MachineState) -> float | None:
        """Speed before something ahead, m/s; None: as it is."""
        spec = self.spec
        return slowed(spec.speed, spec.slow_speed, spec.slow_front, m.front.range)


def hold_course(m: MachineState) -> float:
    """Steering that turns the car back to the corridor's direction and keeps it there."""
    return steering_for(-2.0 / _HOLD_LENGTH * math.sin(m.heading))


@runs(BasicFollowWallSpec)
class BasicFollowWall(WallState[BasicFollowWallSpec]):
    """Wall following that believes every reading."""

    def wanted(self, m: MachineState) -> float:
        """Clearance wanted, m."""
        return self.spec.clearance


@runs(FollowWallSpec)
class FollowWall(WallState[FollowWallSpec]):
    """Wall following that ignores readings which differ from the reading before by more than 2 cm.

    An ignored reading leaves range and rate as they were. The comparison is with the previous raw reading, not with
    the last accepted one: so a wall that has moved for good is followed from its second reading on.
    """

    def accepts(self, sonar: Sonar) -> bool:
        """Whether a reading is near the one before."""
        return abs(sonar.range - sonar.previous) <= self.spec.ignore_jump

    def wanted(self, m: MachineState) -> float:
        """Clearance wanted, m."""
        return self.spec.clearance


@runs(FollowWallRampSpec)
class FollowWallRamp(WallState[FollowWallRampSpec]):
    """Wall following with a clearance linear in the distance driven. Finished at the end of the distance."""

    def on_enter(self, m: MachineState) -> None:
        """Start from the spec's clearances, or from the range now."""
        super().on_enter(m)
        spec = self.spec
        self.finished = False
        self.entry = m.distance
        here = spec.target if self.range is None else self.range
        self.start = here if spec.start is None else spec.start
        self.target = spec.target
        self.length = spec.distance

    def set_target(self, m: MachineState, x: float, y: float, heading: float, gate: int = NO_GATE) -> None:
        """Ramp to a point: its clearance is start - x_camera at a right wall, + at a left one; x_camera = -y."""
        self.target = max(self.start - self.sign * y, 0.05)
        self.length = max(x, 0.05)

    def unreachable(self, m: MachineState) -> str:
        """Why the clearance cannot change so fast."""
        slope = abs(self.target - self.start) / self.length
        steepest = math.tan(math.radians(self.spec.max_angle_deg or 90.0))
        return f"a slope of {slope:.2f} is needed, {steepest:.2f} at most" if slope > steepest else ""

    def wanted(self, m: MachineState) -> float:
        """Clearance wanted now, m."""
        driven = m.distance - self.entry
        self.finished = driven >= self.length
        return ramp(self.start, self.target, self.length, driven)


@runs(ApproachPointSpec)
class ApproachPoint(DrivingState[ApproachPointSpec]):
    """Drives to a point by dead reckoning: on a circle through it, or, with a heading, onto its axis."""

    def on_enter(self, m: MachineState) -> None:
        """Aim at the spec's point, seen from the car now."""
        spec = self.spec
        self.finished = False
        self.gate = NO_GATE
        self.free = spec.heading_deg is None
        self.target: Pose = m.to_reckoning(spec.x, spec.y, math.radians(spec.heading_deg or 0.0))

    def set_target(self, m: MachineState, x: float, y: float, heading: float, gate: int = NO_GATE) -> None:
        """Aim at the point `before` the one that is handed over, on its axis."""
        self.free = False
        self.gate = gate
        self.aim(*m.to_reckoning(x, y, heading))

    def aim(self, x: float, y: float, heading: float) -> None:
        """Set the point `before` a gate at a pose of dead reckoning."""
        back = self.spec.before
        self.target = (x - back * math.cos(heading), y - back * math.sin(heading), heading)

    def tick(self, m: MachineState) -> None:
        """Steer to the point."""
        spec, gate = self.spec, m.gate
        if gate.new and spec.track and gate.id == self.gate:
            self.aim(gate.x, gate.y, gate.heading)
        x, y, heading = m.from_here(*self.target)
        if self.free:
            ahead = x
            steering = pursuit(x, y)
        else:
            cos, sin = math.cos(heading), math.sin(heading)
            ahead = cos * x + sin * y
            steering = line(sin * x - cos * y, -heading, spec.length, math.radians(spec.max_angle_deg))
        self.finished = ahead <= spec.tolerance
        self.steer(m, steering)
        self.drive(m)

    def unreachable(self, m: MachineState) -> str:
        """Why no way leads there."""
        x, y, heading = m.from_here(*self.target)
        if self.free:
            heading = 2.0 * math.atan2(y, x)  # the circle through the point comes there with this heading
        return out_of_reach((x, y, heading), 1.0 / curvature(1.0), self.spec.aside)


@runs(ArucoGateCenterSpec)
class ArucoGateCenter(DrivingState[ArucoGateCenterSpec]):
    """Full lock towards the side on which the gate's middle is, until aligned.

    A gate out of view is followed by dead reckoning. Aligned: the car's heading is within the tolerance of the gate's
    axis, or has swept over it. It also ends when the middle changes sides, since to turn on would lead away from it.
    """

    def on_enter(self, m: MachineState) -> None:
        """Nothing is known of the gate's side yet."""
        self.finished = False
        self.entry = m.distance
        self.side = 0.0
        self.error = math.nan

    def tick(self, m: MachineState) -> None:
        """Turn towards the middle."""
        spec = self.spec
        _, y, heading = m.from_here(m.gate.x, m.gate.y, m.gate.heading)
        side = math.copysign(1.0, y)
        self.finished = (
            m.gate.id < 0
            or abs(heading) <= math.radians(spec.tolerance_deg)
            or heading * self.error < 0.0
            or side * self.side < 0.0
            or m.distance - self.entry >= spec.max_distance
        )
        self.side, self.error = side, heading
        self.steer(m, 0.0 if self.finished else side * spec.lock)
        self.drive(m)


@runs(MotorSpec)
class Motor(DrivingState[MotorSpec]):
    """Fixed steering and speed."""

    def on_enter(self, m: MachineState) -> None:
        """Remember where it began."""
        self.finished = False
        self.entry = m.distance

    def tick(self, m: MachineState) -> None:
        """Output the fixed values."""
        spec = self.spec
        if spec.distance is not None:
            self.finished = m.distance - self.entry >= spec.distance
        self.steer(m, spec.steering)
        self.drive(m)


@runs(StopSpec)
class Stop(State[StopSpec]):
    """Brakes against the direction in which the car rolls, then neutral: more would turn the direction."""

    ROLLING: ClassVar[float] = 0.1
    """m/s"""

    def on_enter(self, m: MachineState) -> None:
        """Remember when it began, and in which direction the car rolls."""
        self.until = m.time + self.spec.hold
        self.direction = m.direction

    def tick(self, m: MachineState) -> None:
        """Wheels straight, brake or neutral."""
        m.steering = 0.0
        m.throttle = -self.spec.brake * self.direction if m.speed > self.ROLLING or m.time < self.until else 0.0
        m.speed_target = 0.0


@runs(IdleSpec)
class Idle(State[IdleSpec]):
    """Does nothing: neutral, wheels straight."""

    def tick(self, m: MachineState) -> None:
        """Neutral."""
        m.steering = m.throttle = 0.0
