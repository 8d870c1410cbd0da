"""Driving to a point by dead reckoning."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from pydantic import Field

from tral_env.geometry import curvature
from tral_env.se2 import Pose, to_inner
from tral_fsm.control.biarc import out_of_reach
from tral_fsm.control.command import Command
from tral_fsm.control.laws import line, pursuit
from tral_fsm.definition.machine import DrivingSpec
from tral_fsm.definition.needs import DISTANCE
from tral_fsm.definition.validated import quantity
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import NO_GATE, DrivingState


class ApproachPointSpec(DrivingSpec):
    """Drives to a point by dead reckoning, and to a gate that is handed over along the gate's axis."""

    targetable: ClassVar[bool] = True

    type: Literal["ApproachPoint"] = "ApproachPoint"
    x: float = quantity(
        1.0,
        "m",
        "the point lies this far ahead of the car at entry; a point that is handed over replaces it",
        ge=-20.0,
        le=20.0,
    )
    y: float = quantity(0.0, "m", "the point lies this far to the left of the car at entry", ge=-20.0, le=20.0)
    heading_deg: float | None = quantity(
        None, "deg", "direction in which the car passes the point, + = left; null: any", ge=-180.0, le=180.0
    )
    before: float = quantity(
        1.0, "m", "ends this far before a gate that is handed over; negative: behind it", ge=-5.0, le=5.0
    )
    tolerance: float = quantity(
        0.05, "m", "the car has arrived when no more than this is left of the way", gt=0.0, le=2.0
    )
    length: float = quantity(0.35, "m", "an offset from the axis falls to 1/e over this length", gt=0.0, le=5.0)
    max_angle_deg: float = quantity(45.0, "deg", "largest angle at which the car approaches the axis", gt=0.0, le=90.0)
    aside: float = quantity(0.1, "m", "the point is out of reach if the car would miss it by more", gt=0.0, le=2.0)
    track: bool = Field(True, description="use each new detection of the gate that was handed over")

    @property
    def finishable(self) -> bool:
        """The state is finished on arrival."""
        return True

    @property
    def readings_needed(self) -> frozenset[str]:
        """Dead reckoning leads to the point."""
        return super().readings_needed | DISTANCE


class ApproachPoint(DrivingState[ApproachPointSpec]):
    """Drives to a point by dead reckoning: on a circle through it, or, with a heading, onto its axis."""

    finished = False
    gate = NO_GATE
    """Id of the gate that the point stands before."""
    free = True
    """The car may pass the point in any direction."""
    point: Pose = (0.0, 0.0, 0.0)
    """Where the car drives to, in the frame of dead reckoning."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Aim at the spec's point, seen from the car now."""
        spec = self.spec
        self.finished = False
        self.gate = NO_GATE
        self.free = spec.heading_deg is None
        self.point = estimate.to_reckoning((spec.x, spec.y, math.radians(spec.heading_deg or 0.0)))

    def set_target(self, estimate: CarEstimate, target: Pose, gate: int = NO_GATE) -> None:
        """Aim at the point `before` the one that is handed over, on its axis."""
        self.free = False
        self.gate = gate
        self.aim_at(*estimate.to_reckoning(target))

    def aim_at(self, x: float, y: float, heading: float) -> None:
        """Set the point `before` a gate at a pose of dead reckoning."""
        back = self.spec.before
        self.point = (x - back * math.cos(heading), y - back * math.sin(heading), heading)

    def tick(self, estimate: CarEstimate) -> Command:
        """Steer to the point."""
        spec, gate = self.spec, estimate.gate
        if gate.new and spec.track and gate.id == self.gate:
            self.aim_at(gate.x, gate.y, gate.heading)
        x, y, heading = estimate.from_here(self.point)
        if self.free:
            ahead = x
            steering = pursuit(x, y)
        else:
            passed, offset = to_inner((x, y, heading), 0.0, 0.0)
            ahead = -passed
            steering = line(offset, -heading, spec.length, math.radians(spec.max_angle_deg))
        self.finished = ahead <= spec.tolerance
        return self.drive(steering)

    def unreachable(self, estimate: CarEstimate) -> str:
        """Why no way leads to the point; empty: one does."""
        x, y, heading = estimate.from_here(self.point)
        if self.free:
            heading = 2.0 * math.atan2(y, x)  # the circle through the point comes there with this heading
        return out_of_reach((x, y, heading), 1.0 / curvature(1.0), self.spec.aside)
