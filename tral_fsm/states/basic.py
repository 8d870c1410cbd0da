"""States that need no estimate of walls or gates: fixed commands, standing still."""

from __future__ import annotations

from tral_fsm.control.command import Command
from tral_fsm.definition.machine import IdleSpec, MotorSpec, StopSpec
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import DrivingState, State

ROLLING_MPS = 0.1
"""A car that is faster rolls, m/s. Source: choice, the hall sensor's slowest reading."""


class Motor(DrivingState[MotorSpec]):
    """Fixed steering and speed."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember where it began."""
        self.finished = False
        self.entry = estimate.distance

    def tick(self, estimate: CarEstimate) -> Command:
        """The fixed values."""
        spec = self.spec
        if spec.distance is not None:
            self.finished = estimate.distance - self.entry >= spec.distance
        return self.drive(spec.steering)


class Stop(State[StopSpec]):
    """Brakes against the direction in which the car rolls, then neutral: more would turn the direction."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember when it began, and in which direction the car rolls."""
        self.until = estimate.time + self.spec.hold
        self.direction = estimate.direction

    def tick(self, estimate: CarEstimate) -> Command:
        """Wheels straight, brake or neutral."""
        brakes = estimate.speed > ROLLING_MPS or estimate.time < self.until
        return Command(speed=0.0, throttle=-self.spec.brake * self.direction if brakes else 0.0)


class Idle(State[IdleSpec]):
    """Does nothing: neutral, wheels straight."""
