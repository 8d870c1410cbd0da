"""Names of the readings that states and conditions may need, as in `tral_env.interface.CORE_FIELDS`."""

from __future__ import annotations

from tral_env.interface import CORE_FIELDS

NOTHING: frozenset[str] = frozenset()
"""No reading: the clock is enough."""
DISTANCE = frozenset({"distance"})
"""What dead reckoning needs of the hall sensor."""
HALL = frozenset({"distance", "speed"})
"""All that the hall sensor gives."""
GATE = frozenset(field.name for field in CORE_FIELDS if field.name.startswith("gate_"))
"""What the camera tells of gates."""
MARKER = frozenset(field.name for field in CORE_FIELDS if field.name.startswith("marker_"))
"""What the camera tells of single markers."""


def ultrasonic(*sides: str) -> frozenset[str]:
    """The ranges of the sides "left", "front", "right"."""
    return frozenset(f"ultrasonic_{side}" for side in sides)


SIDES = ultrasonic("left", "right")
"""The ranges of both sides."""
