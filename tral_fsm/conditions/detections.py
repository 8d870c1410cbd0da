"""Conditions that fire when something is seen: gates and markers."""

from __future__ import annotations

import math
from typing import Any, TypeVar

from tral_fsm.conditions.base import Condition, runs
from tral_fsm.definition.conditions import ArucoGateFoundSpec, MarkerFoundSpec, SightingSpec
from tral_fsm.estimation.estimator import MachineState
from tral_fsm.estimation.sonar import Sighting
from tral_fsm.states.base import State

_POST_MARGIN_M = 0.02
"""A way that leads so near past a post leads through the gate still, m. Source: choice."""

G = TypeVar("G", bound=SightingSpec)


class Seen(Condition[G]):
    """Fires when something is seen ahead, near and fresh enough."""

    counts = False

    def __init__(self, spec: G, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.bearing = math.radians(spec.max_bearing_deg)

    def sighting(self, m: MachineState) -> Sighting:
        """What is looked for."""
        raise NotImplementedError

    def triggered(self, m: MachineState) -> bool:
        """Seen, ahead, near and fresh enough."""
        spec, seen = self.spec, self.sighting(m)
        if seen.id < 0 or seen.age > spec.max_age or (spec.ids and seen.id not in spec.ids):
            return False
        x, y, _ = m.from_here(seen.x, seen.y, seen.heading)
        near = 0.0 < x <= spec.max_ahead and math.hypot(x, y) <= spec.max_distance
        return near and abs(math.atan2(y, x)) <= self.bearing

    def why(self, m: MachineState) -> str:
        """Id, place and age."""
        seen = self.sighting(m)
        x, y, heading = m.from_here(seen.x, seen.y, seen.heading)
        return f"id {seen.id} at {x:.2f}, {y:+.2f} m, {math.degrees(heading):+.0f} deg, {seen.age:.2f} s old"


@runs(ArucoGateFoundSpec)
class ArucoGateFound(Seen[ArucoGateFoundSpec]):
    """Fires when a gate is seen and hands it over."""

    def sighting(self, m: MachineState) -> Sighting:
        """The target; or the nearest gate, or one that is guessed from its marker if that is nearer or the only one."""
        if self.spec.target:
            return m.gates.target
        gate, guess, oldest = m.gate, m.guessed_gate, self.spec.max_age
        if not self.spec.one_post or guess.age > oldest or guess.id == gate.id:
            return gate
        return guess if gate.age > oldest or m.distance_to(guess) < m.distance_to(gate) else gate

    def triggered(self, m: MachineState) -> bool:
        """Seen, as narrow as asked, and missed as asked."""
        spec = self.spec
        if not super().triggered(m):
            return False
        seen = self.sighting(m)
        return (spec.narrower_than is None or seen.opening < spec.narrower_than) and self.is_missed(m, seen)

    def is_missed(self, m: MachineState, seen: Sighting) -> bool:
        """The way straight on does not lead through it; also true where that is not asked."""
        aside = self.spec.missed_by
        if aside is None:
            return True
        _, y, heading = m.from_here(seen.x, seen.y, seen.heading)
        room = seen.room(_POST_MARGIN_M)
        return abs(y) > (room if room == room else aside) * abs(math.cos(heading))

    def hand_over(self, m: MachineState) -> Sighting | None:
        """The gate."""
        return self.sighting(m) if self.spec.hand_over else None


@runs(MarkerFoundSpec)
class MarkerFound(Seen[MarkerFoundSpec]):
    """Fires when a single marker is seen."""

    def sighting(self, m: MachineState) -> Sighting:
        """The nearest marker."""
        return m.marker
