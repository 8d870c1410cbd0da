"""Conditions that fire when something is seen: gates and markers."""

from __future__ import annotations

import math
from typing import Any, Literal, TypeVar

from pydantic import Field

from tral_fsm.conditions.base import Condition
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.validated import MarkerId, quantity
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import State

_POST_MARGIN_M = 0.02
"""A way that leads so near past a post leads through the gate still, m. Source: choice."""


class SightingSpec(ConditionSpec):
    """Base of what fires when something is seen."""

    ids: tuple[MarkerId, ...] = Field((), description="only these ids; empty: any", strict=False)
    max_age: float = quantity(0.25, "s", "the sighting is not older", gt=0.0, le=10.0)
    max_distance: float = quantity(6.0, "m", "it is not farther away", gt=0.0, le=20.0)
    max_ahead: float = quantity(20.0, "m", "it is not farther ahead, by dead reckoning", gt=0.0, le=20.0)
    max_bearing_deg: float = quantity(90.0, "deg", "it is not farther to the side", gt=0.0, le=90.0)


G = TypeVar("G", bound=SightingSpec)


class Seen(Condition[G]):
    """Fires when something is seen ahead, near and fresh enough."""

    counts = False

    def __init__(self, spec: G, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.bearing = math.radians(spec.max_bearing_deg)

    def detection(self, estimate: CarEstimate) -> Detection:
        """What is looked for."""
        raise NotImplementedError

    def triggered(self, estimate: CarEstimate) -> bool:
        """Seen, ahead, near and fresh enough."""
        spec, seen = self.spec, self.detection(estimate)
        if seen.id < 0 or seen.age > spec.max_age or (spec.ids and seen.id not in spec.ids):
            return False
        x, y, _ = estimate.seen_from_here(seen)
        near = 0.0 < x <= spec.max_ahead and math.hypot(x, y) <= spec.max_distance
        return near and abs(math.atan2(y, x)) <= self.bearing

    def why(self, estimate: CarEstimate) -> str:
        """Id, place and age."""
        seen = self.detection(estimate)
        x, y, heading = estimate.seen_from_here(seen)
        return f"id {seen.id} at {x:.2f}, {y:+.2f} m, {math.degrees(heading):+.0f} deg, {seen.age:.2f} s old"


class ArucoGateFoundSpec(SightingSpec):
    """Fires when a gate is seen ahead, and hands its position to the next state."""

    type: Literal["ArucoGateFound"] = "ArucoGateFound"
    hand_over: bool = Field(True, description="the next state must be targetable and takes the gate as its target")
    narrower_than: float | None = quantity(
        None, "m", "only a gate whose opening, as far as it has been seen, is narrower", gt=0.0, le=5.0
    )
    missed_by: float | None = quantity(
        None,
        "m",
        "only if the way straight on misses its middle by more, or, its opening known, does not lead through it",
        ge=0.0,
        le=5.0,
    )
    one_post: bool = Field(
        False, description="also fires when only one of its markers was ever seen: the middle is guessed beside it"
    )
    target: bool = Field(
        False, description="asks of the gate that was handed over last, whole or not, though another one be nearer"
    )

    @property
    def hands_over(self) -> bool:
        """As the file says."""
        return self.hand_over


class ArucoGateFound(Seen[ArucoGateFoundSpec]):
    """Fires when a gate is seen and hands it over."""

    def detection(self, estimate: CarEstimate) -> Detection:
        """The target; or the nearest gate, or one that is guessed from its marker if that is nearer or the only one."""
        if self.spec.target:
            return estimate.target_gate
        gate, guess, oldest = estimate.gate, estimate.guessed_gate, self.spec.max_age
        if not self.spec.one_post or guess.age > oldest or guess.id == gate.id:
            return gate
        return guess if gate.age > oldest or estimate.distance_to(guess) < estimate.distance_to(gate) else gate

    def triggered(self, estimate: CarEstimate) -> bool:
        """Seen, as narrow as asked, and missed as asked."""
        spec = self.spec
        if not super().triggered(estimate):
            return False
        seen = self.detection(estimate)
        return (spec.narrower_than is None or seen.opening < spec.narrower_than) and self.is_missed(estimate, seen)

    def is_missed(self, estimate: CarEstimate, seen: Detection) -> bool:
        """The way straight on does not lead through it; also true where that is not asked."""
        aside = self.spec.missed_by
        if aside is None:
            return True
        _, y, heading = estimate.seen_from_here(seen)
        room = seen.room(_POST_MARGIN_M)
        return abs(y) > (aside if math.isnan(room) else room) * abs(math.cos(heading))

    def hand_over(self, estimate: CarEstimate) -> Detection | None:
        """The gate."""
        return self.detection(estimate) if self.spec.hand_over else None


class MarkerFoundSpec(SightingSpec):
    """Fires when a single marker is seen ahead."""

    type: Literal["MarkerFound"] = "MarkerFound"


class MarkerFound(Seen[MarkerFoundSpec]):
    """Fires when a single marker is seen."""

    def detection(self, estimate: CarEstimate) -> Detection:
        """The nearest marker."""
        return estimate.marker
