"""What states do. Each class runs one spec of `definition`; `tick` writes steering and throttle to the blackboard.

A state of your own: derive a spec from `definition.StateSpec`, a class from `State`, decorate it with `runs`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

from tral_env.interface import MAX_AGE_S
from tral_fsm.control.biarc import out_of_reach
from tral_fsm.control.laws import clip, curvature, line, pursuit
from tral_fsm.definition.machine import (
    STATES,
    ApproachPointSpec,
    ArucoGateCenterSpec,
    DrivingSpec,
    IdleSpec,
    MotorSpec,
    StateSpec,
    StopSpec,
)
from tral_fsm.definition.validated import register
from tral_fsm.estimation.estimator import MachineState, Pose

S = TypeVar("S", bound=StateSpec)
D = TypeVar("D", bound=DrivingSpec)

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

    def decorate(runtime: R) -> R:
        RUNTIMES[register(STATES, spec)] = runtime
        return runtime

    return decorate


class DrivingState(State[D]):
    """A state that moves the car."""

    def steer(self, m: MachineState, steering: float) -> None:
        """Set the steering, with the spec's trim, and the trim and lock that were learnt."""
        m.given_trim = self.spec.steering_trim
        m.steering = clip(steering / m.lock_scale + m.given_trim + m.trim)

    def drive(self, m: MachineState, speed: float | None = None) -> None:
        """Set the throttle: open loop, or regulated to the spec's speed or to the one given [m/s]."""
        spec = self.spec
        if spec.throttle is not None:
            m.push(spec.throttle)
        elif spec.speed is not None:
            m.regulate(spec.speed if speed is None else speed)


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

    The gate is the one that a state was handed last, or the nearest one if that is behind the car or long out of view.
    A gate out of view is followed by dead reckoning. Aligned: the car's heading is within the tolerance of the gate's
    axis, or has swept over it. It also ends when the middle changes sides, since to turn on would lead away from it.
    """

    def on_enter(self, m: MachineState) -> None:
        """Nothing is known of the gate's side yet."""
        self.finished = False
        target = m.gates.target
        if target.id < 0 or target.age >= MAX_AGE_S or m.from_here(target.x, target.y, target.heading)[0] <= 0.0:
            m.gates.aim(m.gate)
        self.entry = m.distance
        self.side = 0.0
        self.error = math.nan

    def tick(self, m: MachineState) -> None:
        """Turn towards the middle."""
        spec = self.spec
        gate = m.gates.target
        _, y, heading = m.from_here(gate.x, gate.y, gate.heading)
        side = math.copysign(1.0, y)
        self.finished = (
            gate.id < 0
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
