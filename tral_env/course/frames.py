"""Where the segments of a course lie in the plane: one frame a segment, all headings multiples of 90 degrees."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tral_env.course.layout import Branch, Course, Segment
from tral_env.course.plan import Array

TURNS = {"left": 1, "right": -1, "straight": 0, "end": 0}
"""Quarter turns, counter-clockwise."""
_COS, _SIN = (1, 0, -1, 0), (0, 1, 0, -1)

Rect = tuple[float, float, float, float]
"""x0, y0, x1, y1."""


@dataclass(frozen=True)
class Frame:
    """Place of one segment: local coordinates are `along` the middle line and `left` of it."""

    segment: Segment
    x: float
    """Start of the middle line, m."""
    y: float
    quarter: int
    """Heading in quarter turns, 0 to 3."""
    clear_from: float
    """The plain part, away from corners and crossings, begins here, m along."""
    clear_to: float
    """The plain part ends here, m along."""
    reach_back: float
    """The corridor's floor begins this far before the start (it covers the corner square), m."""
    reach_on: float
    """The corridor's floor goes on this far behind the end, m."""

    @property
    def yaw(self) -> float:
        """Heading, rad, in (-pi, pi]."""
        return (0.0, np.pi / 2, np.pi, -np.pi / 2)[self.quarter]

    def point(self, along: float, left: float) -> tuple[float, float]:
        """Course coordinates of a local point."""
        c, s = _COS[self.quarter], _SIN[self.quarter]
        return self.x + c * along - s * left, self.y + s * along + c * left

    def points(self, local: Array) -> Array:
        """Course coordinates of local points, (n, 2) -> (n, 2)."""
        c, s = _COS[self.quarter], _SIN[self.quarter]
        return np.column_stack([self.x + c * local[:, 0] - s * local[:, 1], self.y + s * local[:, 0] + c * local[:, 1]])

    def rect(self, along0: float, along1: float, left0: float, left1: float) -> Rect:
        """Axis-aligned rectangle in course coordinates."""
        x0, y0 = self.point(along0, left0)
        x1, y1 = self.point(along1, left1)
        return min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)

    @property
    def corridor(self) -> Rect:
        """Floor of the corridor with the corner squares at its ends."""
        half = self.segment.width / 2
        return self.rect(-self.reach_back, self.segment.length + self.reach_on, -half, half)


def place(course: Course) -> list[Frame]:
    """Frame of every segment; the first starts at the origin and heads along x."""
    frames: list[Frame] = []
    x = y = 0.0
    quarter = 0
    for i, segment in enumerate(course.segments):
        before, after = _neighbour(course, i - 1), _neighbour(course, i + 1)
        back = node_half(before, segment) if before else 0.0
        on = node_half(segment, after) if after else 0.0
        frame = Frame(
            segment,
            x,
            y,
            quarter,
            clear_from=back,
            clear_to=segment.length - on,
            reach_back=before.width / 2 if before and TURNS[before.then] else 0.0,
            reach_on=after.width / 2 if after and TURNS[segment.then] else 0.0,
        )
        frames.append(frame)
        x, y = frame.point(segment.length, 0.0)
        quarter = (quarter + TURNS[segment.then]) % 4
    return frames


def node_half(segment: Segment, after: Segment) -> float:
    """Half the extent, along the segment, of the corner or crossing at its end."""
    sides = [branch_width(branch, segment, after) for branch in segment.branches if branch.to != "straight"]
    if TURNS[segment.then]:
        sides.append(after.width)
    return max(sides, default=0.0) / 2


def branch_width(branch: Branch, segment: Segment, after: Segment) -> float:
    """Width of a branch at the end of a segment, m."""
    opposite = branch.to != "straight" and segment.then != "straight"
    return branch.width or (after.width if opposite else segment.width)


@dataclass(frozen=True)
class Stub:
    """A branch of a crossing that the route does not take."""

    rect: Rect
    """Floor behind the crossing's edge."""
    throat: Rect
    """Floor from the middle of the crossing to its edge."""


def stubs(frame: Frame, after: Frame) -> Iterator[Stub]:
    """Branches at the end of a segment."""
    segment, end = frame.segment, frame.segment.length
    edge = max(segment.width, after.segment.width) if segment.then == "straight" else segment.width
    for branch in segment.branches:
        half = branch_width(branch, segment, after.segment) / 2
        if branch.to == "straight":
            on = node_half(segment, after.segment)
            yield Stub(
                frame.rect(end + on, end + on + branch.length, -half, half), frame.rect(end, end + on, -half, half)
            )
        else:
            sign = TURNS[branch.to]
            yield Stub(
                frame.rect(end - half, end + half, sign * edge / 2, sign * (edge / 2 + branch.length)),
                frame.rect(end - half, end + half, 0.0, sign * edge / 2),
            )


def _neighbour(course: Course, i: int) -> Segment | None:
    if course.closed:
        return course.segments[i % len(course.segments)]
    return course.segments[i] if 0 <= i < len(course.segments) else None
