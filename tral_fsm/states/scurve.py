"""The approach to a gate or point on two arcs.

The program of 2016 gave it up, since hall values and steering did not repeat. Here the car follows the way under
control, and plans it again from each detection of the gate.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal, NamedTuple

from pydantic import Field

from tral_env.se2 import Pose, relative
from tral_fsm.control.biarc import Biarc, arc_coordinates, biarc, out_of_reach, pose_on_arc
from tral_fsm.control.command import Command
from tral_fsm.control.laws import clipped_steering_for, curvature_onto
from tral_fsm.definition.machine import DrivingSpec
from tral_fsm.definition.needs import HALL
from tral_fsm.definition.validated import quantity
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import NO_GATE, DrivingState

_LEAD_S = 0.1
"""The state commands a curvature this long before it is needed, since servo and command lag, s. Source: choice."""
_LAST_PLAN = 0.5
"""Nearer to the end of the arcs than this the plan moves with the gate and is not made again, m. Source: choice; there
small errors would give tight arcs."""

_MARGIN_M = 0.05
"""Free space on each side of the car in a gate that counts as within reach, m. Source: choice."""


class SCurveSpec(DrivingSpec):
    """Drives to a point, or before a gate that is handed over, on two arcs of equal radius that end on its axis."""

    targetable: ClassVar[bool] = True

    type: Literal["SCurve"] = "SCurve"
    x: float = quantity(
        2.0,
        "m",
        "the point lies this far ahead of the car at entry; a point that is handed over replaces it",
        ge=-20.0,
        le=20.0,
    )
    y: float = quantity(0.0, "m", "the point lies this far to the left of the car at entry", ge=-20.0, le=20.0)
    heading_deg: float = quantity(
        0.0, "deg", "direction in which the car passes the point, + = left", ge=-180.0, le=180.0
    )
    before: float = quantity(
        0.5, "m", "ends this far before a gate that is handed over; negative: behind it", ge=-5.0, le=5.0
    )
    straight: float = quantity(0.2, "m", "the last part of the way is straight, along the axis", ge=0.0, le=10.0)
    radius: float = quantity(
        0.75, "m", "smallest radius of an arc: a target that needs a smaller one is out of reach", gt=0.0, le=100.0
    )
    tolerance: float = quantity(
        0.05, "m", "the car has arrived when no more than this is left of the way", gt=0.0, le=2.0
    )
    aside: float = quantity(
        0.1,
        "m",
        "the target is out of reach if the car would miss it by more; a known opening of a gate replaces this",
        gt=0.0,
        le=2.0,
    )
    length: float = quantity(0.35, "m", "an offset from the way falls to 1/e over this length", gt=0.0, le=5.0)
    max_angle_deg: float = quantity(25.0, "deg", "largest angle at which the car approaches the way", gt=0.0, le=90.0)
    track: bool = Field(True, description="plan again from each new detection of the gate that was handed over")

    @property
    def finishable(self) -> bool:
        """The state is finished on arrival."""
        return True

    @property
    def readings_needed(self) -> frozenset[str]:
        """Dead reckoning leads along the arcs, and the way is looked up ahead by the speed."""
        return super().readings_needed | HALL


class PathError(NamedTuple):
    """The car beside its way."""

    curvature: float
    """Of the way, a lead ahead, 1/m."""
    offset: float
    """To the left of the way, m."""
    heading: float
    """Against the direction of the way, rad."""


class SCurve(DrivingState[SCurveSpec]):
    """Follows two arcs and a straight end: their curvature ahead of time, and `control.laws.curvature_onto` for errors.

    The plan stands in the frame of the target, so that it moves with the target. Where no two arcs lead to the target,
    the axis itself is the way.
    """

    finished = False
    gate = NO_GATE
    """Id of the gate that the arcs end before."""
    target: Pose = (0.0, 0.0, 0.0)
    """Where the arcs end, in the frame of dead reckoning."""
    arcs: Biarc | None = None
    """None: no two arcs lead to the target."""
    first_start: Pose = (0.0, 0.0, 0.0)
    """Where the first arc begins, seen from the target."""
    second_start: Pose = (0.0, 0.0, 0.0)
    """Where the second arc begins, seen from the target."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Plan the way to the spec's point, seen from the car now."""
        spec = self.spec
        self.finished = False
        self.gate = NO_GATE
        self.plan_to(estimate, estimate.to_reckoning((spec.x, spec.y, math.radians(spec.heading_deg))), 0.0)

    def set_target(self, estimate: CarEstimate, target: Pose, gate: int = NO_GATE) -> None:
        """Plan the way to the point `before` the one that is handed over, on its axis."""
        self.gate = gate
        self.plan_to(estimate, estimate.to_reckoning(target), self.spec.before)

    def plan_to(self, estimate: CarEstimate, pose: Pose, before: float) -> None:
        """Plan the way to a pose of dead reckoning."""
        self.target = pose_on_arc(pose, -before - self.spec.straight)
        """Where the arcs end."""
        self.plan(estimate)

    def plan(self, estimate: CarEstimate) -> None:
        """Lay two arcs from the car to the target."""
        arcs = biarc(*estimate.from_here(self.target))
        self.arcs = arcs if arcs is not None and abs(arcs.curvature) * self.spec.radius <= 1.0 else None
        if self.arcs is not None:
            self.first_start = relative(self.target, estimate.pose)
            self.second_start = pose_on_arc(self.first_start, self.arcs.first, self.arcs.curvature)

    def replan(self, estimate: CarEstimate, gate: Detection) -> None:
        """Take a new detection of the gate: plan again or, near the end, move the plan."""
        old = self.arcs
        self.target = pose_on_arc((gate.x, gate.y, gate.heading), -self.spec.before - self.spec.straight)
        if old is None or estimate.from_here(self.target)[0] > _LAST_PLAN:
            self.plan(estimate)
            self.arcs = self.arcs or old

    def tick(self, estimate: CarEstimate) -> Command:
        """Follow the way."""
        spec = self.spec
        gate, guess = estimate.gate, estimate.guessed_gate
        if spec.track and gate.new and gate.id == self.gate:
            self.replan(estimate, gate)
        if spec.track and guess.new and guess.id == self.gate and not estimate.gate_seen_whole:
            self.replan(estimate, guess)
        here = relative(self.target, estimate.pose)
        self.finished = here[0] >= spec.straight - spec.tolerance
        error = self.path_error(here, _LEAD_S * estimate.speed)
        correction = curvature_onto(error.offset, error.heading, spec.length, math.radians(spec.max_angle_deg))
        return self.drive(clipped_steering_for(error.curvature + correction))

    def path_error(self, here: Pose, lead: float) -> PathError:
        """The car beside its way, with the curvature `lead` metres ahead."""
        arcs = self.arcs
        if arcs is None:
            return PathError(0.0, here[1], here[2])
        x, y, heading = relative(self.first_start, here)
        s, offset, direction = arc_coordinates(x, y, arcs.curvature)
        if s < arcs.first:
            return PathError(self.curvature(arcs, s + lead), offset, heading - direction)
        x, y, heading = relative(self.second_start, here)
        s, offset, direction = arc_coordinates(x, y, -arcs.curvature)
        if s < arcs.second:
            return PathError(self.curvature(arcs, arcs.first + s + lead), offset, heading - direction)
        return PathError(0.0, here[1], here[2])

    @staticmethod
    def curvature(arcs: Biarc, s: float) -> float:
        """Curvature of the way at a distance from its beginning."""
        if s < arcs.first:
            return arcs.curvature
        return -arcs.curvature if s < arcs.first + arcs.second else 0.0

    def unreachable(self, estimate: CarEstimate) -> str:
        """Why the end of the arcs cannot be reached; empty: it can."""
        passed = min(max(relative(self.target, estimate.pose)[0], 0.0), self.spec.straight)
        return out_of_reach(
            estimate.from_here(pose_on_arc(self.target, passed)), self.spec.radius, self.aside(estimate)
        )

    def aside(self, estimate: CarEstimate) -> float:
        """How far the car may miss the target, m: in a gate of known opening, the free space beside the car."""
        gate = estimate.target_gate
        room = gate.room(_MARGIN_M) if gate.id == self.gate else math.nan
        return room if not math.isnan(room) else self.spec.aside
