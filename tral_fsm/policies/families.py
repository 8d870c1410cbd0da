"""Which packaged machine drives which family of courses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

MACHINES: Mapping[str, str] = {
    "straight": "wall",
    "doors": "doors",
    "corners": "corners",
    "loop": "loop",
    "lane_change": "lane_change",
    "obstacles": "obstacles",
    "gates": "gate_scurve",
    "crossing": "crossing",
}
"""Family -> the machine that is made for it."""
EVERYWHERE = "office"
"""The machine that drives all families."""


def machine_for(families: Sequence[str]) -> str:
    """The machine that is made for a family; that of all families for several, or for one that has none."""
    return MACHINES.get(families[0], EVERYWHERE) if len(families) == 1 else EVERYWHERE
