"""What an arrangement is made of: boxes, arrows, room for labels. Pure data, the same for each way to draw it.

All numbers are whole px; x points to the right, y down. Boxes, and what arrows end and turn at, are multiples of 10, as
UMLet's grid is at zoom 10.
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
    """A rectangle; x, y is its upper left corner."""

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
    """Their places in `machine.transitions`, in order; one alone unless they are bundled."""
    points: tuple[Point, ...]
    """From the outline of the box that is left to that of the box that is entered."""
    label: Rect
    """Room for its text; nothing else is there."""


@dataclass(frozen=True)
class Arrangement:
    """Where all of a machine stands."""

    width: int
    height: int
    direction: Direction
    """Where most arrows lead."""
    boxes: tuple[Rect, ...]
    """Of each state, in the machine's order."""
    routes: tuple[Route, ...]
    root: tuple[Point, Point]
    """The arrow without a beginning that points to the root."""
