"""The line the car should take: middle lines, arcs at corners, smooth shifts around obstacles and through gates.

In a segment the line is a chain of cubic Hermite pieces between knots (along, left, slope).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tral_env.config import CarConfig
from tral_env.course.frames import TURNS, Frame
from tral_env.course.layout import Course, Segment
from tral_env.course.plan import Array, Plan
from tral_env.errors import CourseError

STEP = 0.09
"""Spacing of the points along the middle line, m; slanted parts are longer, and stay under 0.1 m."""
CORNER_RADIUS = 0.9
"""m; full lock gives 0.64 m."""
SHIFT = 2.0
"""A shift to the side takes this long, m, where there is room."""
GATE_STRAIGHT = 0.5
"""The line is straight this far before and behind a gate, m."""
PASSING = 0.5
"""The line keeps this far from what stands in the way, m, where there is room (the car is 0.2 m wide)."""
MIN_PASSAGE = 0.5
"""A narrower gap is no way, m."""
AHEAD, BEHIND = 0.40, 0.12
"""The shift is done this far before an obstacle, and begins this far behind, m: the car's overhangs from its rear
axle, and a little."""
CLEARANCE = 0.05
"""The car's outline keeps at least this far from every box on the line, m."""
PLAIN = 1.0
"""Clearances are measured this far from doors, corners, gates and obstacles, m."""
MIN_STRAIGHT = 0.5
"""Shorter plain stretches are left out, m."""


@dataclass(frozen=True)
class Knot:
    """A place on the line, in a segment's coordinates."""

    along: float
    left: float
    slope: float = 0.0


def plan_route(course: Course, frames: list[Frame], problems: list[str]) -> Array:
    """Lay the line from the start pose to the goal line.

    Args:
        course: what is to be driven.
        frames: its segments' places.
        problems: what stands in the way is added here.

    Returns:
        (R, 2) points at most 0.1 m apart. A closed course's line is one lap that ends where it begins.
    """
    pieces: list[Array] = []
    for i, frame in enumerate(frames):
        begin, end = _span(course, i)
        if end - begin < 0.1:
            problems.append(
                f"/segments/{i}/length: got {frame.segment.length:g}. Allowed: above "
                f"{frame.segment.length + begin - end:.3g}, for the arcs at its ends, start and goal"
            )
            continue
        first = Knot(begin, course.start.offset, np.tan(np.radians(course.start.heading_deg)))
        knots = [first if i == 0 and not course.closed else Knot(begin, 0.0)]
        knots += _knots(frame.segment, f"/segments/{i}", problems)
        # The goal line may be crossed anywhere; a corner is entered in the middle.
        hold = frame.segment.then == "end" and end - knots[-1].along < SHIFT
        knots.append(Knot(end, knots[-1].left if hold else 0.0))
        if any(b.along - a.along < 0.1 for a, b in pairwise(knots)):
            places = ", ".join(f"{knot.along:.2f}" for knot in knots)
            problems.append(f"/segments/{i}: things stand too near to each other or to a corner: knots at {places} m")
            continue
        pieces.append(frame.points(_sample(_relax(knots))))
        if TURNS[frame.segment.then]:
            pieces.append(frame.points(_arc(frame.segment.length - CORNER_RADIUS, TURNS[frame.segment.then])))
    if problems:
        return np.zeros((0, 2))
    if course.closed:
        return _from_start(np.concatenate(pieces), frames[0], course)
    return _without_repeats(np.concatenate(pieces))


def _span(course: Course, i: int) -> tuple[float, float]:
    """Stretch of segment i between its arcs, or from the start, or to the goal, m along."""
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
        yaw = np.radians(gate.yaw_deg)
        along, left, slope = GATE_STRAIGHT * np.cos(yaw), GATE_STRAIGHT * np.sin(yaw), float(np.tan(yaw))
        pairs.append(
            (Knot(gate.at - along, gate.offset - left, slope), Knot(gate.at + along, gate.offset + left, slope))
        )
    for begin, end, blocked in _groups(_blocks(segment)):
        left = _passage(blocked, segment.width / 2)
        if left is None:
            problems.append(f"{where}: no way of {MIN_PASSAGE:g} m past what stands from {begin:.2f} to {end:.2f} m")
        elif left or end - begin > AHEAD + BEHIND:
            pairs.append((Knot(begin, left), Knot(end, left)))
    return [knot for pair in sorted(pairs, key=lambda pair: pair[0].along) for knot in pair]


def _blocks(segment: Segment) -> list[tuple[float, float, float, float]]:
    """What stands in the way: first and last along where the line must be past it, right and left edge."""
    blocks = []
    for box in segment.obstacles:
        c, s = abs(np.cos(np.radians(box.yaw_deg))), abs(np.sin(np.radians(box.yaw_deg)))
        along, left = (box.length * c + box.width * s) / 2, (box.length * s + box.width * c) / 2
        blocks.append((box.at - along - AHEAD, box.at + along + BEHIND, box.offset - left, box.offset + left))
    for cupboard in segment.cupboards:
        wall, along = TURNS[cupboard.side] * segment.width / 2, cupboard.length / 2
        edges = sorted((wall, wall - TURNS[cupboard.side] * cupboard.depth))
        blocks.append((cupboard.at - along - AHEAD, cupboard.at + along + BEHIND, edges[0], edges[1]))
    return sorted(blocks)


def _groups(
    blocks: list[tuple[float, float, float, float]],
) -> list[tuple[float, float, list[tuple[float, float]]]]:
    """Blocks beside each other are passed as one: begin, end, blocked (right, left) edges."""
    groups: list[tuple[float, float, list[tuple[float, float]]]] = []
    for begin, end, right, left in blocks:
        if groups and begin < groups[-1][1]:
            first, last, edges = groups.pop()
            groups.append((first, max(last, end), [*edges, (right, left)]))
        else:
            groups.append((begin, end, [(right, left)]))
    return groups


def _passage(blocked: list[tuple[float, float]], half: float) -> float | None:
    """Where to pass, m left: the way nearest to the middle line that is wide enough."""
    ways, right = [], -half
    for edge_right, edge_left in [*sorted(blocked), (half, half)]:
        if edge_right - right >= MIN_PASSAGE:
            keep = min(PASSING, (edge_right - right) / 2)
            ways.append(float(np.clip(0.0, right + keep, edge_right - keep)))
        right = max(right, edge_left)
    return min(ways, key=abs, default=None)


def _relax(knots: list[Knot]) -> list[Knot]:
    """Between knots far apart the line goes back to the middle, in shifts of `SHIFT`."""
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


def _sample(knots: list[Knot]) -> Array:
    """Points of the line, (n, 2): along, left."""
    pieces = [np.array([[knots[-1].along, knots[-1].left]])]
    for a, b in reversed(list(pairwise(knots))):
        gap, rise = b.along - a.along, b.left - a.left
        steep = 1.5 * abs(rise) / gap + max(abs(a.slope), abs(b.slope))
        t = np.arange(n := int(np.ceil(gap * np.hypot(1.0, steep) / STEP))) / n
        left = a.left + rise * t * t * (3 - 2 * t) + gap * t * (1 - t) * (a.slope * (1 - t) - b.slope * t)
        pieces.insert(0, np.column_stack([a.along + gap * t, left]))
    return np.concatenate(pieces)


def _arc(along: float, turn: int) -> Array:
    """Points of the quarter circle that begins at `along`, (n, 2)."""
    angle = np.linspace(0.0, np.pi / 2, int(np.ceil(CORNER_RADIUS * np.pi / 2 / STEP)) + 1)
    forward, aside = CORNER_RADIUS * np.sin(angle), CORNER_RADIUS * (1 - np.cos(angle))
    return np.column_stack([along + forward, turn * aside])


def _without_repeats(points: Array) -> Array:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([points[:1], points[1:][steps > 1e-6]])


def _from_start(ring: Array, frame: Frame, course: Course) -> Array:
    """Turn a ring so that it begins beside the start, and close it."""
    ring = _without_repeats(ring)
    if np.linalg.norm(ring[-1] - ring[0]) < 1e-6:
        ring = ring[:-1]
    at = int(np.linalg.norm(ring - frame.point(course.start.at, 0.0), axis=1).argmin())
    return np.concatenate([ring[at:], ring[: at + 1]])


def straights(course: Course, frames: list[Frame]) -> Array:
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


def outline(car: CarConfig) -> Array:
    """Points around the car, (P, 2), in its frame."""
    rear = car.middle_x - car.length / 2
    x, y = np.linspace(rear, rear + car.length, 5), np.linspace(-car.width / 2, car.width / 2, 3)
    edge = [(a, b) for a in x for b in y if a in (x[0], x[-1]) or b in (y[0], y[-1])]
    return np.array(edge)


def bends(points: Array) -> Array:
    """Curvature of a line at its inner points, (R, 2) -> (R - 2,) 1/m, + to the left."""
    step = np.diff(points, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    turn = np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))
    curvature: Array = 2 * turn / (length[:-1] + length[1:])
    return curvature


def headings(points: Array) -> Array:
    """Heading of a line at its points, (R, 2) -> (R,) rad, unwrapped."""
    step = np.diff(points, axis=0)
    angle = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    return np.concatenate([angle[:1], (angle[:-1] + angle[1:]) / 2, angle[-1:]])


def clearance(plan: Plan, car: CarConfig | None = None, reach: float = 0.2) -> float:
    """Least distance between the car's outline and any box while the car follows the route, m, at most `reach`.

    The distance is taken between the outline's points and the boxes, and between the boxes' corners and the outline.
    """
    car = car or CarConfig()
    near_route, near_box = _near(plan, np.hypot(car.middle_x + car.length / 2, car.width / 2) + reach)
    if not len(near_route):
        return reach
    yaw = headings(plan.route)[near_route]
    route, box_yaw, size = plan.route[near_route], plan.box_yaw[near_box], plan.box_size[near_box, :2]
    middle = plan.box_position[near_box, :2]
    points = route[:, None] + _turned(outline(car)[None], yaw)
    to_box = _outside(_turned(points - middle[:, None], -box_yaw), size[:, None])
    corners = middle[:, None] + _turned(size[:, None] * [[1, 1], [1, -1], [-1, 1], [-1, -1]], box_yaw)
    local = _turned(corners - route[:, None], -yaw) - [car.middle_x, 0.0]
    to_car = _outside(local, np.array([car.length / 2, car.width / 2]))
    return float(min(reach, to_box.min(), to_car.min()))


def _near(plan: Plan, radius: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of a route point and a box no further apart than `radius`."""
    offset = plan.route[:, None] - plan.box_position[None, :, :2]
    c, s = np.cos(plan.box_yaw), np.sin(plan.box_yaw)
    x, y = np.abs(c * offset[..., 0] + s * offset[..., 1]), np.abs(c * offset[..., 1] - s * offset[..., 0])
    pairs = np.nonzero((x < plan.box_size[:, 0] + radius) & (y < plan.box_size[:, 1] + radius))
    return pairs[0], pairs[1]


def _turned(points: Array, yaw: Array) -> Array:
    """Turn points (n, p, 2) by yaw (n,)."""
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    return np.stack([c * points[..., 0] - s * points[..., 1], s * points[..., 0] + c * points[..., 1]], axis=-1)


def _outside(points: Array, half: Array) -> Array:
    """Distance of points to a rectangle about the origin, (..., 2) -> (...); 0 inside."""
    gap: Array = np.maximum(np.abs(points) - half, 0.0)
    return np.hypot(gap[..., 0], gap[..., 1])


def check_drivable(plan: Plan, name: str, car: CarConfig | None = None) -> None:
    """Make sure that the car can follow the route.

    Raises:
        CourseError: the route bends more than the car can, or the car would come nearer than `CLEARANCE` to a box, or
            stands so near to one at the start.
    """
    car = car or CarConfig()
    bend = np.abs(bends(plan.route))
    allowed = float(np.tan(car.full_lock)) / car.wheelbase
    if bend.max() > allowed:
        x, y = plan.route[1 + bend.argmax()]
        raise CourseError(
            f"course '{name}': the route bends with a radius of {1 / bend.max():.2f} m at ({x:.2f}, {y:.2f}). "
            f"Allowed: {1 / allowed:.2f} m or more, the car's full lock"
        )
    gap = clearance(plan, car)
    if gap < CLEARANCE:
        raise CourseError(
            f"course '{name}': on the route the car comes within {gap:.3f} m of a box. Allowed: {CLEARANCE:g} m or more"
        )
    # A ring's route does not begin at the start, but in the middle beside it.
    x, y, yaw = plan.start
    gap = clearance(replace(plan, route=np.array([[x, y], [x + 0.01 * np.cos(yaw), y + 0.01 * np.sin(yaw)]])), car)
    if gap < CLEARANCE:
        raise CourseError(
            f"course '{name}': /start: the car stands within {gap:.3f} m of a box. Allowed: {CLEARANCE:g} m or more"
        )
