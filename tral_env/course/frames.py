"""Where the segments of a course lie in the plane: one frame a segment, all headings multiples of 90 degrees."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from tral_env.course.layout import Branch, Course, Segment
from tral_env.se2 import rotate

TURNS = {"left": 1, "right": -1, "straight": 0, "end": 0}
"""The heading changes by so many quarter turns, counter-clockwise, where the route goes on so."""
_COS, _SIN = (1, 0, -1, 0), (0, 1, 0, -1)
"""Cosine and sine of 0 to 3 quarter turns: whole numbers, so that walls that should meet do."""

Rect = tuple[float, float, float, float]
"""A level rectangle: x0, y0, x1, y1, m."""


class Frame(NamedTuple):
    """Place of one segment; its coordinates are `along` the middle line and `left` of it, m."""

    segment: Segment
    x: float
    """The middle line starts here, m."""
    y: float
    """The middle line starts here, m."""
    quarter: int
    """Heading in quarter turns, 0 to 3."""
    cos: int
    """Cosine of the heading."""
    sin: int
    """Sine of the heading."""
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
        x, y = rotate(self.cos, self.sin, along, left)
        return self.x + x, self.y + y

    def rect(self, along0: float, along1: float, left0: float, left1: float) -> Rect:
        """The level rectangle, in course coordinates, between two places along and two places left."""
        x0, y0 = self.point(along0, left0)
        x1, y1 = self.point(along1, left1)
        return x0 if x0 < x1 else x1, y0 if y0 < y1 else y1, x1 if x0 < x1 else x0, y1 if y0 < y1 else y0

    @property
    def corridor(self) -> Rect:
        """Floor of the corridor with the corner squares at its ends."""
        half = self.segment.width / 2
        return self.rect(-self.reach_back, self.segment.length + self.reach_on, -half, half)


def place_segments(course: Course) -> list[Frame]:
    """Place every segment behind the one before; the first starts at the origin and heads along x."""
    frames: list[Frame] = []
    x = y = 0.0
    quarter = 0
    nodes = [_node(course, i) for i in range(len(course.segments))]
    before = nodes[-1] if course.closed else (0.0, 0.0, 0.0)
    for segment, node in zip(course.segments, nodes, strict=True):
        frame = Frame(
            segment,
            x,
            y,
            quarter,
            _COS[quarter],
            _SIN[quarter],
            clear_from=before[0],
            clear_to=segment.length - node[0],
            reach_back=before[1],
            reach_on=node[2],
        )
        frames.append(frame)
        x, y = frame.point(segment.length, 0.0)
        quarter = (quarter + TURNS[segment.then]) % 4
        before = node
    return frames


def _node(course: Course, i: int) -> tuple[float, float, float]:
    """Measure the node, the corner or crossing, at the end of segment i.

    Returns:
        Half its extent along the segment, how far the floor of the next segment reaches back into it, and how far the
        floor of this segment reaches on, m.
    """
    segments = course.segments
    if i + 1 == len(segments) and not course.closed:
        return 0.0, 0.0, 0.0
    segment, after = segments[i], segments[(i + 1) % len(segments)]
    turns = TURNS[segment.then] != 0
    return node_half(segment, after), segment.width / 2 if turns else 0.0, after.width / 2 if turns else 0.0


def node_half(segment: Segment, after: Segment) -> float:
    """Half the extent, along the segment, of the corner or crossing at its end, m."""
    if not segment.branches:
        return after.width / 2 if TURNS[segment.then] else 0.0
    sides = [branch_width(branch, segment, after) for branch in segment.branches if branch.to != "straight"]
    if TURNS[segment.then]:
        sides.append(after.width)
    return max(sides, default=0.0) / 2


def branch_width(branch: Branch, segment: Segment, after: Segment) -> float:
    """Width of a branch at the end of a segment, m."""
    opposite = branch.to != "straight" and segment.then != "straight"
    return branch.width or (after.width if opposite else segment.width)


class Stub(NamedTuple):
    """A branch of a crossing that the route does not take."""

    rect: Rect
    """Floor behind the crossing's edge."""
    throat: Rect
    """Floor from the middle of the crossing to its edge."""


def stubs(frame: Frame, after: Frame) -> Iterator[Stub]:
    """Lay out the branches at the end of a segment, in the order of the course file."""
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
