"""States that need no walls and no gates: fixed commands, stopping, waiting."""

from __future__ import annotations

from typing import ClassVar, Literal

from tral_fsm.control.command import Command
from tral_fsm.control.speed import BRAKE, ROLLING_MPS, SingleBrake
from tral_fsm.definition.machine import DrivingSpec, StateSpec
from tral_fsm.definition.needs import DISTANCE, NOTHING
from tral_fsm.definition.validated import quantity
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import DrivingState, State


class MotorSpec(DrivingSpec):
    """Drives with fixed steering and speed, for a distance or until a transition fires."""

    never_finishes_hint: ClassVar[str] = "a Motor needs a distance for that"

    type: Literal["Motor"] = "Motor"
    steering: float = quantity(0.0, "", "+1 = full left", ge=-1.0, le=1.0)
    distance: float | None = quantity(
        None, "m", "distance after which the state is finished; null: never", gt=0.0, le=1000.0
    )

    @property
    def finishable(self) -> bool:
        """The state is finished after its distance, if it has one."""
        return self.distance is not None

    @property
    def readings_needed(self) -> frozenset[str]:
        """A distance is counted by the hall sensor."""
        return super().readings_needed | (NOTHING if self.distance is None else DISTANCE)


class Motor(DrivingState[MotorSpec]):
    """Fixed steering and speed."""

    finished = False
    entry = 0.0
    """`CarEstimate.distance` at entry, m."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember where the state began."""
        self.finished = False
        self.entry = estimate.distance

    def tick(self, estimate: CarEstimate) -> Command:
        """The fixed values."""
        spec = self.spec
        if spec.distance is not None:
            self.finished = estimate.distance - self.entry >= spec.distance
        return self.drive(spec.steering)


class StopSpec(StateSpec):
    """Stops the car: brakes while it rolls, then neutral."""

    type: Literal["Stop"] = "Stop"
    brake: float = quantity(BRAKE, "", "throttle against the direction in which the car rolls", ge=0.0, le=1.0)
    hold: float = quantity(
        0.0,
        "s",
        "shortest time of braking: a motor controller reverses only after it has seen the brake",
        ge=0.0,
        le=60.0,
    )

    @property
    def may_end(self) -> bool:
        """A stopped car may stay."""
        return True

    @property
    def readings_needed(self) -> frozenset[str]:
        """The brake works while the car rolls; one that holds for a time works without a speed too."""
        return NOTHING if self.brake == 0.0 or self.hold > 0.0 else frozenset({"speed"})


class Stop(State[StopSpec]):
    """Brakes against the direction in which the car rolls, then stays in neutral, so that the car does not reverse."""

    until = 0.0
    """Time until which the state brakes in any case, s."""
    direction = 1.0
    """Direction in which the car rolled at entry: +1 forward, -1 backward."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Remember when the state began and in which direction the car rolls."""
        self.until = estimate.time + self.spec.hold
        self.direction = estimate.direction
        self.brake = SingleBrake()

    def tick(self, estimate: CarEstimate) -> Command:
        """Wheels straight, brake or neutral."""
        brakes = self.brake.tick(estimate.speed > ROLLING_MPS or estimate.time < self.until)
        return Command(0.0, speed=0.0, throttle=-self.spec.brake * self.direction if brakes else 0.0)


class IdleSpec(StateSpec):
    """Does nothing: the command stays at neutral."""

    type: Literal["Idle"] = "Idle"


class Idle(State[IdleSpec]):
    """Does nothing: motor and servo in neutral."""
