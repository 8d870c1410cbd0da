"""Conditions that fire when the camera sees a gate or a marker."""

from __future__ import annotations

import math
from typing import Any, Literal, TypeVar

from pydantic import Field

from tral_fsm.conditions.base import Condition
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.needs import GATE, MARKER
from tral_fsm.definition.validated import MarkerId, quantity
from tral_fsm.estimation.detections import MIN_SUPPORT, Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import State

_POST_MARGIN_M = 0.02
"""Smallest distance between car and post on a way that leads through the gate, m. Source: choice."""


class DetectionSpec(ConditionSpec):
    """Base of the specs of conditions that fire when the camera sees something."""

    ids: tuple[MarkerId, ...] = Field((), description="fires only for these ids; empty: for any", strict=False)
    readings: int = Field(
        MIN_SUPPORT, description="number of images in a row that must agree on the place", ge=MIN_SUPPORT, le=100
    )
    max_age: float = quantity(0.25, "s", "largest age of the detection", gt=0.0, le=10.0)
    max_distance: float = quantity(6.0, "m", "largest distance", gt=0.0, le=20.0)
    max_ahead: float = quantity(20.0, "m", "largest distance ahead, by dead reckoning", gt=0.0, le=20.0)
    max_bearing_deg: float = quantity(90.0, "deg", "largest angle to either side", gt=0.0, le=90.0)


G = TypeVar("G", bound=DetectionSpec)


class DetectionCondition(Condition[G]):
    """Fires when the camera sees something ahead that is near and fresh enough.

    `detection` only looks up what the estimate holds, so it may be asked several times in a tick.
    """

    counts = False

    def __init__(self, spec: G, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.bearing = math.radians(spec.max_bearing_deg)
        self.max_age, self.readings, self.ids = spec.max_age, spec.readings, spec.ids  # asked in each tick

    def detection(self, estimate: CarEstimate) -> Detection:
        """What the condition looks for."""
        raise NotImplementedError

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the detection is ahead, near and fresh enough, and wanted."""
        seen = self.detection(estimate)
        if seen.age > self.max_age or seen.support < self.readings or (self.ids and seen.id not in self.ids):
            return False
        spec = self.spec
        x, y, _ = estimate.seen_from_here(seen)
        near = 0.0 < x <= spec.max_ahead and math.hypot(x, y) <= spec.max_distance
        return near and abs(math.atan2(y, x)) <= self.bearing and self.is_wanted(estimate, seen)

    def is_wanted(self, estimate: CarEstimate, seen: Detection) -> bool:
        """Whether a detection that is ahead, near and fresh enough is one that the file asks for."""
        return True

    def why(self, estimate: CarEstimate) -> str:
        """Id, place and age of the detection."""
        seen = self.detection(estimate)
        x, y, heading = estimate.seen_from_here(seen)
        place = f"id {seen.id} at {x:.2f}, {y:+.2f} m, {math.degrees(heading):+.0f} deg"
        return f"{place}, {seen.age:.2f} s old, {seen.support} images agree"


class ArucoGateFoundSpec(DetectionSpec):
    """Fires when the car sees a gate ahead, and hands the gate to the next state."""

    type: Literal["ArucoGateFound"] = "ArucoGateFound"
    hand_over: bool = Field(True, description="the next state, which must be targetable, takes the gate as its target")
    narrower_than: float | None = quantity(
        None, "m", "fires only for a gate whose known opening is narrower than this", gt=0.0, le=5.0
    )
    missed_by: float | None = quantity(
        None,
        "m",
        "fires only if the way straight on misses the gate: its known opening, or else its middle by more than this",
        ge=0.0,
        le=5.0,
    )
    one_post: bool = Field(
        False, description="fires also when the car has seen only one marker of the gate; the middle is then guessed"
    )
    target: bool = Field(
        False, description="looks only at the gate that was handed over last, even if another one is nearer"
    )

    @property
    def hands_over(self) -> bool:
        """As the file says in `hand_over`."""
        return self.hand_over

    @property
    def readings_needed(self) -> frozenset[str]:
        """Gates, and single markers where one post is enough or the opening counts."""
        single = self.one_post or self.narrower_than is not None
        return GATE | MARKER if single else GATE


class ArucoGateFound(DetectionCondition[ArucoGateFoundSpec]):
    """Fires when the car sees a gate, and hands the gate over."""

    def detection(self, estimate: CarEstimate) -> Detection:
        """The target gate, or the nearest gate, or the gate guessed from one marker if it is nearer or the only one."""
        if self.spec.target:
            return estimate.target_gate
        gate, guess, oldest = estimate.gate, estimate.guessed_gate, self.spec.max_age
        if not self.spec.one_post or guess.age > oldest or guess.id == gate.id:
            return gate
        return guess if gate.age > oldest or estimate.distance_to(guess) < estimate.distance_to(gate) else gate

    def is_wanted(self, estimate: CarEstimate, seen: Detection) -> bool:
        """Whether the gate is as narrow as asked, and missed as asked."""
        limit = self.spec.narrower_than
        return (limit is None or seen.opening < limit) and self._is_missed(estimate, seen)

    def _is_missed(self, estimate: CarEstimate, seen: Detection) -> bool:
        """Whether the way straight on does not lead through the gate, or the file does not ask for that."""
        if self.spec.missed_by is None:
            return True
        _, y, heading = estimate.seen_from_here(seen)
        half_opening = seen.room(_POST_MARGIN_M)
        if math.isnan(half_opening):
            half_opening = self.spec.missed_by
        return abs(y) > half_opening * abs(math.cos(heading))

    def hand_over(self, estimate: CarEstimate) -> Detection | None:
        """The gate."""
        return self.detection(estimate) if self.spec.hand_over else None


class MarkerFoundSpec(DetectionSpec):
    """Fires when the car sees a single marker ahead."""

    type: Literal["MarkerFound"] = "MarkerFound"

    @property
    def readings_needed(self) -> frozenset[str]:
        """Single markers."""
        return MARKER


class MarkerFound(DetectionCondition[MarkerFoundSpec]):
    """Fires when a single marker is seen."""

    def detection(self, estimate: CarEstimate) -> Detection:
        """The nearest marker."""
        return estimate.marker
