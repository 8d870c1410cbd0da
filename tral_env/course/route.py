"""The line that the car should take: middle lines, arcs at corners, smooth shifts around obstacles and through gates.

In a segment the line is a chain of cubic Hermite pieces between knots (along, left, slope).
"""

from __future__ import annotations

import math
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np

from tral_env.arrays import Array
from tral_env.course.frames import TURNS, Frame
from tral_env.course.layout import Course, Segment
from tral_env.course.overlap import level_half
from tral_env.course.plan import steps
from tral_env.se2 import rotate

STEP = 0.09
"""Points of the line are at most this far apart, m; the promise is 0.1 m."""
CORNER_RADIUS = 0.9
"""The arc at a corner has this radius, m; full lock gives 0.64 m."""
SHIFT = 2.0
"""A shift to the side takes this length of corridor, m, where there is room."""
GATE_STRAIGHT = 0.5
"""The line is straight this far before and behind a gate, m."""
PASSING = 0.5
"""The line keeps this far from what stands in the way, m, where there is room (the car is 0.2 m wide)."""
MIN_PASSAGE = 0.5
"""A gap narrower than this is no way, m."""
AHEAD = 0.40
"""The line has shifted this far before an obstacle, m: the car reaches 0.33 m ahead of its rear axle."""
BEHIND = 0.12
"""The line shifts back from this far behind an obstacle on, m: the car reaches 0.07 m behind its rear axle."""
PLAIN = 1.0
"""Clearances are measured this far from doors, corners, gates and obstacles, m."""
MIN_STRAIGHT = 0.5
"""A plain stretch shorter than this is left out, m."""


class Knot(NamedTuple):
    """A place on the line, in a segment's coordinates."""

    along: float
    """m from the segment's start."""
    left: float
    """m left of the middle line."""
    slope: float = 0.0
    """Change of `left` for a metre `along`."""


def plan_route(course: Course, frames: list[Frame], problems: list[str]) -> Array:
    """Lay the line from the start pose to the goal line.

    Args:
        course: what is to be driven.
        frames: places of its segments.
        problems: gets a sentence for each thing that leaves the line no room.

    Returns:
        (R, 2) points at most 0.1 m apart. A closed course's line is one lap that ends where it begins.
    """
    line = _Line()
    for i, frame in enumerate(frames):
        begin, end = _span(course, i)
        if end - begin < 0.1:
            problems.append(
                f"/segments/{i}/length: got {frame.segment.length:g}. Allowed: above "
                f"{frame.segment.length + begin - end:.3g}, for the arcs at its ends, start and goal"
            )
            continue
        knots = [_first_knot(course, begin) if i == 0 and not course.closed else Knot(begin, 0.0)]
        knots += _knots(frame.segment, f"/segments/{i}", problems)
        # The goal line may be crossed anywhere; a corner is entered in the middle.
        hold = frame.segment.then == "end" and end - knots[-1].along < SHIFT
        knots.append(Knot(end, knots[-1].left if hold else 0.0))
        if any(b.along - a.along < 0.1 for a, b in pairwise(knots)):
            places = ", ".join(f"{knot.along:.2f}" for knot in knots)
            problems.append(f"/segments/{i}: things stand too near to each other or to a corner: knots at {places} m")
            continue
        line.follow(frame, _relax(knots))
        if TURNS[frame.segment.then]:
            line.turn(frame, frame.segment.length - CORNER_RADIUS, TURNS[frame.segment.then])
    if problems:
        return np.zeros((0, 2))
    points = _without_repeats(line.points())
    return _from_start(points, frames[0], course) if course.closed else points


def _first_knot(course: Course, begin: float) -> Knot:
    """Where the line of a course that is no ring begins: where the car starts, in its heading."""
    return Knot(begin, course.start.offset, float(np.tan(np.radians(course.start.heading_deg))))


def _span(course: Course, i: int) -> tuple[float, float]:
    """Stretch of segment i between the arcs at its ends, or from the start, or to the goal, m along."""
    segment, before = course.segments[i], course.segments[i - 1]
    begin = CORNER_RADIUS if (i or course.closed) and TURNS[before.then] else 0.0
    if i == 0 and not course.closed:
        begin = course.start.at
    end = segment.length - (CORNER_RADIUS if TURNS[segment.then] else 0.0)
    return begin, end - course.goal if segment.then == "end" else end


def _knots(segment: Segment, where: str, problems: list[str]) -> list[Knot]:
    """Knots at gates and around what stands in the way, in order."""
    pairs = []
    for gate in segment.gates:
        yaw = math.radians(gate.yaw_deg)
        along, aside, slope = GATE_STRAIGHT * math.cos(yaw), GATE_STRAIGHT * math.sin(yaw), float(np.tan(yaw))
        before = Knot(gate.at - along, gate.offset - aside, slope)
        pairs.append((before, Knot(gate.at + along, gate.offset + aside, slope)))
    for begin, end, blocked in _groups(_blocks(segment)):
        left = _passage(blocked, segment.width / 2)
        if left is None:
            problems.append(f"{where}: no way of {MIN_PASSAGE:g} m past what stands from {begin:.2f} to {end:.2f} m")
        elif left or end - begin > AHEAD + BEHIND:
            pairs.append((Knot(begin, left), Knot(end, left)))
    return [knot for pair in sorted(pairs, key=lambda pair: pair[0].along) for knot in pair]


def _blocks(segment: Segment) -> list[tuple[float, float, float, float]]:
    """What stands in the way: first and last place along where the line must be past it, right and left edge, m."""
    blocks = []
    for box in segment.obstacles:
        yaw = math.radians(box.yaw_deg)
        along, left = level_half(box.length / 2, box.width / 2, math.cos(yaw), math.sin(yaw))
        blocks.append((box.at - along - AHEAD, box.at + along + BEHIND, box.offset - left, box.offset + left))
    for cupboard in segment.cupboards:
        wall, along = TURNS[cupboard.side] * segment.width / 2, cupboard.length / 2
        edges = sorted((wall, wall - TURNS[cupboard.side] * cupboard.depth))
        blocks.append((cupboard.at - along - AHEAD, cupboard.at + along + BEHIND, edges[0], edges[1]))
    return sorted(blocks)


def _groups(
    blocks: list[tuple[float, float, float, float]],
) -> list[tuple[float, float, list[tuple[float, float]]]]:
    """Join blocks beside each other, which are passed as one: begin, end, blocked (right, left) edges."""
    groups: list[tuple[float, float, list[tuple[float, float]]]] = []
    for begin, end, right, left in blocks:
        if groups and begin < groups[-1][1]:
            first, last, edges = groups.pop()
            groups.append((first, max(last, end), [*edges, (right, left)]))
        else:
            groups.append((begin, end, [(right, left)]))
    return groups


def _passage(blocked: list[tuple[float, float]], half: float) -> float | None:
    """Find where to pass, m left: the gap nearest to the middle line that is wide enough; None: there is none."""
    ways, right = [], -half
    for edge_right, edge_left in [*sorted(blocked), (half, half)]:
        if edge_right - right >= MIN_PASSAGE:
            keep = min(PASSING, (edge_right - right) / 2)
            ways.append(min(max(0.0, right + keep), edge_right - keep))
        right = max(right, edge_left)
    return min(ways, key=abs, default=None)


def _relax(knots: list[Knot]) -> list[Knot]:
    """Let the line go back to the middle, in shifts of `SHIFT`, between knots that are far apart."""
    relaxed = knots[:1]
    for a, b in pairwise(knots):
        a_in, b_in = not (a.left or a.slope), not (b.left or b.slope)
        room = b.along - a.along
        if room > SHIFT * ((not a_in) + (not b_in)):
            if not a_in:
                relaxed.append(Knot(a.along + SHIFT, 0.0))
            if not b_in:
                relaxed.append(Knot(b.along - SHIFT, 0.0))
        relaxed.append(b)
    return relaxed


class _Line:
    """Points of the line, gathered piece by piece and worked out all at once.

    A piece begins at (along, left) with the slope m0 and ends at (along + gap, left + rise) with the slope m1. Its
    points are a cubic in Hermite form, with t from 0 to 1 and u = 1 - t:
    ``along + gap t`` and ``left + rise t^2 (3 - 2 t) + gap t u (m0 u - m1 t)``.
    Arcs are pieces of no length to which a quarter circle is added, the same for all.
    """

    def __init__(self) -> None:
        self._counts: list[int] = []
        self._pieces: list[tuple[float, ...]] = []

    def _add(self, count: int, frame: Frame, piece: tuple[float, ...]) -> None:
        self._counts.append(count)
        self._pieces.append((count, frame.x, frame.y, frame.cos, frame.sin, *piece))

    def follow(self, frame: Frame, knots: list[Knot]) -> None:
        """Add cubic pieces from knot to knot."""
        for a, b in pairwise(knots):
            gap, rise = b.along - a.along, b.left - a.left
            # Nowhere is the cubic steeper than this: t^2 (3 - 2 t) climbs by at most 1.5.
            steep = 1.5 * abs(rise) / gap + max(abs(a.slope), abs(b.slope))
            count = math.ceil(gap * math.sqrt(1.0 + steep * steep) / STEP)
            self._add(count, frame, (a.along, a.left, gap, rise, a.slope, b.slope, 0.0))
        self._add(1, frame, (knots[-1].along, knots[-1].left, 0.0, 0.0, 0.0, 0.0, 0.0))

    def turn(self, frame: Frame, along: float, turn: int) -> None:
        """Add the quarter circle that begins at `along`, to the left (+1) or the right (-1)."""
        self._add(len(_ARC), frame, (along, 0.0, 0.0, 0.0, 0.0, 0.0, turn))

    def points(self) -> Array:
        """Points (n, 2) of all pieces, in course coordinates, m."""
        counts, width = np.array(self._counts), len(self._pieces[0])
        pieces = np.fromiter(chain.from_iterable(self._pieces), float, width * len(counts)).reshape(-1, width)
        count, x, y, c, s, along, left, gap, rise, slope, slope_on, turn = np.repeat(pieces, counts, axis=0).T
        k = np.arange(len(count)) - np.repeat(counts.cumsum() - counts, counts)
        t = k / count
        u = 1 - t
        along = along + gap * t
        left = left + rise * t * t * (3 - 2 * t) + gap * t * u * (slope * u - slope_on * t)
        bent = np.flatnonzero(turn)
        arc = _ARC[k[bent]]
        along[bent] += arc[:, 0]
        left[bent] += turn[bent] * arc[:, 1]
        points = np.empty((len(count), 2))
        on, across = rotate(c, s, along, left)
        np.add(on, x, out=points[:, 0])
        np.add(across, y, out=points[:, 1])
        return points


def _quarter_circle() -> Array:
    """Points of the arc of a corner to the left, (n, 2): along, left, m."""
    angle = np.linspace(0.0, np.pi / 2, int(np.ceil(CORNER_RADIUS * np.pi / 2 / STEP)) + 1)
    return np.column_stack([CORNER_RADIUS * np.sin(angle), CORNER_RADIUS * (1 - np.cos(angle))])


_ARC = _quarter_circle()


def _without_repeats(points: Array) -> Array:
    _, _, length = steps(points)
    keep = np.ones(len(points), bool)
    keep[1:] = length > 1e-6
    return points[keep]


def _from_start(ring: Array, frame: Frame, course: Course) -> Array:
    """Turn a ring so that it begins beside the start, and close it."""
    if np.linalg.norm(ring[-1] - ring[0]) < 1e-6:
        ring = ring[:-1]
    at = int(np.linalg.norm(ring - frame.point(course.start.at, 0.0), axis=1).argmin())
    return np.concatenate([ring[at:], ring[: at + 1]])


def straights(frames: list[Frame]) -> Array:
    """Stretches of plain parallel walls, (S, 5): see `Plan.straights`."""
    found = []
    for frame in frames:
        segment = frame.segment
        blocked = [(frame.clear_from, frame.clear_from), (frame.clear_to, frame.clear_to)]
        blocked += [(door.at - door.width / 2, door.at + door.width / 2) for door in segment.doors]
        blocked += [(gate.at, gate.at) for gate in segment.gates]
        blocked += [(begin + AHEAD, end - BEHIND) for begin, end, *_ in _blocks(segment)]
        blocked.sort()
        free = blocked[0][1]
        for begin, end in blocked[1:]:
            length = begin - free - 2 * PLAIN
            if length >= MIN_STRAIGHT:
                found.append((*frame.point(free + PLAIN, 0.0), frame.yaw, length, segment.width))
            free = max(free, end)
    return np.array(found, float).reshape(-1, 5)
