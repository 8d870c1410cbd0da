"""Turning before a gate until the car is aligned with its axis, as in 2016."""

from __future__ import annotations

import math
from typing import Literal

from tral_env.interface import MAX_AGE_S
from tral_fsm.control.command import Command
from tral_fsm.definition.machine import DrivingSpec
from tral_fsm.definition.needs import DISTANCE, GATE
from tral_fsm.definition.validated import quantity
from tral_fsm.estimation.detections import NOTHING
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import DrivingState


class ArucoGateCenterSpec(DrivingSpec):
    """Steers with full lock towards the gate's middle until the car is aligned with the gate's axis."""

    type: Literal["ArucoGateCenter"] = "ArucoGateCenter"
    tolerance_deg: float = quantity(4.0, "deg", "the car is aligned within this angle", gt=0.0, le=45.0)
    lock: float = quantity(1.0, "", "share of full lock", gt=0.0, le=1.0)
    max_distance: float = quantity(
        1.5, "m", "the state gives up, and is finished, after this distance", gt=0.0, le=20.0
    )

    @property
    def finishable(self) -> bool:
        """The state is finished when the car is aligned."""
        return True

    @property
    def readings_needed(self) -> frozenset[str]:
        """The gate, and dead reckoning to it."""
        return super().readings_needed | DISTANCE | GATE


class ArucoGateCenter(DrivingState[ArucoGateCenterSpec]):
    """Steers with full lock towards the side on which the gate's middle is.

    The gate is the one that was handed to a state last, or the nearest one if that gate is behind the car or long out
    of view. The state follows a gate out of view by dead reckoning. The car is aligned when its heading is within the
    tolerance of the gate's axis, or has just passed it. The state also ends when the middle changes sides, since the
    car would turn away from it.
    """

    finished = False
    gate = NOTHING
    """The gate to whose middle the car turns."""
    entry = 0.0
    """`CarEstimate.distance` at entry, m."""
    side = 0.0
    """Side of the middle in the tick before: +1 left, -1 right, 0 not known."""
    error = math.nan
    """Angle to the axis in the tick before, rad."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Nothing is known of the gate's side yet."""
        self.finished = False
        self.gate = target = estimate.target_gate
        self.own_target = None
        if target.id < 0 or target.age >= MAX_AGE_S or estimate.seen_from_here(target)[0] <= 0.0:
            self.gate = self.own_target = estimate.gate
        self.entry = estimate.distance
        self.side = 0.0
        self.error = math.nan

    def tick(self, estimate: CarEstimate) -> Command:
        """Turn towards the middle."""
        spec = self.spec
        for seen in (estimate.gate, estimate.guessed_gate):
            if seen.new and seen.id == self.gate.id:
                self.gate = seen
        _, y, heading = estimate.seen_from_here(self.gate)
        side = math.copysign(1.0, y)
        self.finished = (
            self.gate.id < 0
            or abs(heading) <= math.radians(spec.tolerance_deg)
            or heading * self.error < 0.0
            or side * self.side < 0.0
            or estimate.distance - self.entry >= spec.max_distance
        )
        self.side, self.error = side, heading
        return self.drive(0.0 if self.finished else side * spec.lock)
