"""Parts of an arrangement as data: boxes, arrows, and room for labels.

All numbers are whole px; x points to the right, y down. Boxes, ends and turns of arrows lie on multiples of 10, the
grid of UMLet at zoom 10.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Point = tuple[int, int]
Direction = Literal["right", "down"]
Size = tuple[int, int]
"""Width and height, px."""


@dataclass(frozen=True)
class Rect:
    """A rectangle with its upper left corner x, y."""

    x: int
    y: int
    w: int
    h: int

    def overlaps(self, other: Rect) -> bool:
        """Whether the two have area in common."""
        return (
            self.x < other.x + other.w
            and other.x < self.x + self.w
            and self.y < other.y + other.h
            and other.y < self.y + self.h
        )


@dataclass(frozen=True)
class Route:
    """The arrow of all transitions from one state to another."""

    transitions: tuple[int, ...]
    """Indices in `machine.transitions`, in order; one alone unless they are bundled."""
    points: tuple[Point, ...]
    """Points from the outline of the source box to that of the target box."""
    label: Rect
    """Room for the text alone."""


@dataclass(frozen=True)
class Arrangement:
    """Places of all parts of a machine."""

    width: int
    height: int
    direction: Direction
    """Direction of most arrows."""
    boxes: tuple[Rect, ...]
    """Box of each state, in the order of the machine."""
    routes: tuple[Route, ...]
    root: tuple[Point, Point]
    """Arrow from nowhere to the root."""
