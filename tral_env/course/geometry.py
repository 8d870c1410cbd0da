"""From a course to boxes: walls without gaps or overlaps, doors, frames, obstacles, marker boards.

The floor is a union of rectangles; `walls.cut_walls` puts walls around it, `route` lays the line through it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tral_env.course import route as routes
from tral_env.course.frames import TURNS, Frame, Rect, branch_width, place, stubs
from tral_env.course.layout import Course, Door, Gate, Tape
from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.course.walls import cut_walls
from tral_env.errors import CourseError

WALL_THICKNESS = 0.15
"""m."""
HEIGHT = {"wall": 0.5, "door": 0.5, "frame": 0.5, "obstacle": 0.35}
"""m; low enough for a chase camera to see over, far above the sonars' plane."""
ROOM = 1.5
"""Depth and width of the room behind an open door, m."""
LEAF = 0.04
"""Thickness of an open door's leaf, m."""
FRAME_WIDTH = 0.06
"""Along the wall, on each side of a door, m."""
BOARD_WIDTH = 0.24
"""Marker of 0.18 m with a quiet zone of one module (0.03 m) on each side."""
BOARD_THICKNESS = 0.03
"""m."""
SIGN_HEIGHT = 0.22
"""Middle of a turn marker above the floor, m."""
FACE_GAP = 0.002
"""A marker's face stands this far before its board or wall, m."""


@dataclass
class _Space:
    """Rectangles of a course while it is being worked out."""

    floor: list[Rect] = field(default_factory=list)
    """Floor that has walls around it."""
    cut: list[Rect] = field(default_factory=list)
    """Floor inside the thickness of a wall: recesses and open doorways."""
    leaf: list[Rect] = field(default_factory=list)
    """Closed doors, inside the thickness of a wall."""
    boxes: list[tuple[str, float, float, float, float, float, float]] = field(default_factory=list)
    """Kind, x, y, yaw, half length, half width, height of what stands on the floor."""
    markers: list[tuple[int, float, float, float, float]] = field(default_factory=list)
    """Id, x, y, z, yaw."""


def build_plan(course: Course) -> Plan:
    """Work out the geometry of a course.

    Raises:
        CourseError: parts do not fit together, overlap, or leave the car no way; all problems with their places.
    """
    frames = place(course.checked())
    problems = list(_fit_problems(course, frames))
    route = routes.plan_route(course, frames, problems)
    if problems:
        raise CourseError("\n  ".join([f"course '{course.name}': {len(problems)} problem(s)", *problems]))
    space = _Space()
    for i, frame in enumerate(frames):
        _add_segment(space, frame, frames[(i + 1) % len(frames)])
    gates = [(frame, gate) for frame in frames for gate in frame.segment.gates]
    start = course.start
    plan = Plan(
        **_box_arrays(space),
        route=route,
        start=np.array([*frames[0].point(start.at, start.offset), np.radians(start.heading_deg)]),
        gate_pose=np.array(
            [(*frame.point(gate.at, gate.offset), frame.yaw + np.radians(gate.yaw_deg)) for frame, gate in gates]
        ).reshape(-1, 3),
        gate_width=np.array([gate.width for _, gate in gates], float),
        gate_id=np.array([gate.id for _, gate in gates], np.int64),
        marker_position=np.array([marker[1:4] for marker in space.markers], float).reshape(-1, 3),
        marker_yaw=np.array([marker[4] for marker in space.markers], float),
        marker_id=np.array([marker[0] for marker in space.markers], np.int64),
        tape=np.array([_tape(frame, tape) for frame in frames for tape in frame.segment.tapes], float).reshape(-1, 4),
        straights=routes.straights(course, frames),
        laps=course.laps,
    )
    routes.check_drivable(plan, course.name)
    return plan


def _add_segment(space: _Space, frame: Frame, after: Frame) -> None:
    segment = frame.segment
    space.floor.append(frame.corridor)
    for stub in stubs(frame, after):
        space.floor += [stub.rect, stub.throat]
    for door in segment.doors:
        _add_door(space, frame, door)
    for cupboard in segment.cupboards:
        left = TURNS[cupboard.side] * (segment.width - cupboard.depth) / 2
        x, y = frame.point(cupboard.at, left)
        space.boxes.append(
            ("obstacle", x, y, frame.yaw, cupboard.length / 2, cupboard.depth / 2, HEIGHT["wall"] - 0.02)
        )
    for box in segment.obstacles:
        x, y = frame.point(box.at, box.offset)
        yaw = frame.yaw + np.radians(box.yaw_deg)
        space.boxes.append(("obstacle", x, y, yaw, box.length / 2, box.width / 2, HEIGHT["obstacle"]))
    for gate in segment.gates:
        _add_gate(space, frame, gate)
    if segment.branches and segment.sign:
        _add_sign(space, frame, after)


def _add_door(space: _Space, frame: Frame, door: Door) -> None:
    sign, half, wall = TURNS[door.side], door.width / 2, frame.segment.width / 2

    def rect(along0: float, along1: float, deep0: float, deep1: float) -> Rect:
        return frame.rect(door.at + along0, door.at + along1, sign * (wall + deep0), sign * (wall + deep1))

    if door.open:
        space.cut.append(rect(-half, half, 0.0, WALL_THICKNESS))
        space.floor.append(rect(-ROOM / 2, ROOM / 2, WALL_THICKNESS, WALL_THICKNESS + ROOM))
        x, y = frame.point(door.at + half + LEAF / 2, sign * (wall + WALL_THICKNESS + half))
        space.boxes.append(("door", x, y, frame.yaw, LEAF / 2, half, HEIGHT["door"]))
    else:
        space.cut.append(rect(-half, half, 0.0, door.recess))
        space.leaf.append(rect(-half, half, door.recess, WALL_THICKNESS))
    if door.frame > 0:
        for end in (-half - FRAME_WIDTH / 2, half + FRAME_WIDTH / 2):
            x, y = frame.point(door.at + end, sign * (wall - door.frame / 2))
            space.boxes.append(("frame", x, y, frame.yaw, FRAME_WIDTH / 2, door.frame / 2, HEIGHT["frame"]))


def _add_gate(space: _Space, frame: Frame, gate: Gate) -> None:
    x, y = frame.point(gate.at, gate.offset)
    yaw = frame.yaw + np.radians(gate.yaw_deg)
    ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    out, height = (gate.width + BOARD_WIDTH) / 2, gate.marker_height + BOARD_WIDTH / 2
    for k, sign in enumerate((1, -1)):
        board = np.array([x, y]) + sign * out * left
        face = board - (BOARD_THICKNESS / 2 + FACE_GAP) * ahead
        space.boxes.append(("post", *board, yaw, BOARD_THICKNESS / 2, BOARD_WIDTH / 2, height))
        space.markers.append((2 * gate.id + k, *face, gate.marker_height, yaw + np.pi))


def _add_sign(space: _Space, frame: Frame, after: Frame) -> None:
    """Hang the marker on the wall ahead, beside the way straight on if there is one."""
    segment = frame.segment
    ways = {str(branch.to): branch_width(branch, segment, after.segment) for branch in segment.branches}
    ways[segment.then] = after.segment.width
    side = segment.then if segment.then != "straight" else ("left" if "left" in ways else "right")
    if "straight" in ways:
        far, left = ways[side] / 2, TURNS[side] * (ways["straight"] / 2 + BOARD_WIDTH / 2 + 0.03)
    else:
        # A wider branch opposite makes a step in the wall ahead, in the middle.
        far, left = ways[side] / 2, TURNS[side] * (0.0 if max(ways.values()) == ways[side] else BOARD_WIDTH / 2 + 0.03)
    x, y = frame.point(segment.length + far - FACE_GAP, left)
    marker = {"left": 40, "right": 41, "straight": 42}[segment.then]
    space.markers.append((marker, x, y, SIGN_HEIGHT, frame.yaw + np.pi))


def _tape(frame: Frame, tape: Tape) -> tuple[float, float, float, float]:
    half = tape.length / 2
    along, left = (0.0, half) if tape.across else (half, 0.0)
    ends = (frame.point(tape.at - along, tape.offset - left), frame.point(tape.at + along, tape.offset + left))
    return (*ends[0], *ends[1])


def _box_arrays(space: _Space) -> dict[str, Any]:
    rows = [*_flat("wall", cut_walls(space.floor, [*space.cut, *space.leaf], WALL_THICKNESS))]
    rows += [*_flat("door", space.leaf), *space.boxes]
    table = np.array([row[1:] for row in rows])
    half_height = table[:, 5] / 2
    return {
        "box_kind": np.array([BOX_KINDS.index(row[0]) for row in rows], np.int64),
        "box_position": np.column_stack([table[:, :2], half_height]),
        "box_yaw": table[:, 2],
        "box_size": np.column_stack([table[:, 3:5], half_height]),
    }


def _flat(kind: str, rects: list[Rect]) -> Iterator[tuple[str, float, float, float, float, float, float]]:
    for x0, y0, x1, y1 in rects:
        yield kind, (x0 + x1) / 2, (y0 + y1) / 2, 0.0, (x1 - x0) / 2, (y1 - y0) / 2, HEIGHT[kind]


def _fit_problems(course: Course, frames: list[Frame]) -> Iterator[str]:
    for i, frame in enumerate(frames):
        yield from _segment_problems(f"/segments/{i}", frame)
    if course.closed:
        end = frames[-1].point(frames[-1].segment.length, 0.0)
        quarter = (frames[-1].quarter + TURNS[frames[-1].segment.then]) % 4
        if max(abs(end[0]), abs(end[1])) > 1e-6 or quarter:
            got = f"({end[0]:.3f}, {end[1]:.3f}) heading {90 * quarter} deg"
            yield f"/closed: the last segment ends at {got}. Allowed: (0, 0) heading 0 deg, where the first one begins"
    yield from overlap_problems(course, frames)


def _segment_problems(where: str, frame: Frame) -> Iterator[str]:
    segment = frame.segment
    for k, door in enumerate(segment.doors):
        low, high = frame.clear_from + door.width / 2 + FRAME_WIDTH, frame.clear_to - door.width / 2 - FRAME_WIDTH
        if not low <= door.at <= high:
            yield f"{where}/doors/{k}/at: got {door.at:g}. Allowed: {low:g} to {high:g}, between corners"
    for k, cupboard in enumerate(segment.cupboards):
        low, high = frame.clear_from + cupboard.length / 2, frame.clear_to - cupboard.length / 2
        if not low <= cupboard.at <= high:
            yield f"{where}/cupboards/{k}/at: got {cupboard.at:g}. Allowed: {low:g} to {high:g}, between corners"
    for k, gate in enumerate(segment.gates):
        room = (segment.width - gate.width) / 2 - BOARD_WIDTH
        if abs(gate.offset) > room + 1e-9:
            got = f"boards of {BOARD_WIDTH:g} m beside a gate of {gate.width:g} m, {gate.offset:g} m off the middle"
            yield f"{where}/gates/{k}: {got}, stick in the wall. Allowed: offset within {room:g}"


def overlap_problems(course: Course, frames: list[Frame]) -> Iterator[str]:
    """Parts that are not neighbours must leave room for two walls between them."""
    names: list[str] = []
    rects: list[Rect] = []
    nodes: list[tuple[int, int]] = []
    count = len(frames)
    for i, frame in enumerate(frames):
        on = (i + 1) % count if course.closed else i + 1
        names.append(f"/segments/{i}")
        rects.append(frame.corridor)
        nodes.append((i, on))
        for k, stub in enumerate(stubs(frame, frames[(i + 1) % count])):
            names.append(f"/segments/{i}/branches/{k}")
            rects.append(stub.rect)
            nodes.append((on, on))
        for k, door in enumerate(frame.segment.doors):
            if door.open:
                wall = TURNS[door.side] * (frame.segment.width / 2 + WALL_THICKNESS)
                names.append(f"/segments/{i}/doors/{k}")
                rects.append(frame.rect(door.at - ROOM / 2, door.at + ROOM / 2, wall, wall + TURNS[door.side] * ROOM))
                nodes.append((-1 - i, -1 - i))
    table, ends = np.array(rects), np.array(nodes)
    low, high = table[:, None, :2] - 2 * WALL_THICKNESS, table[:, None, 2:] + 2 * WALL_THICKNESS
    near = ((table[None, :, 2:] > low + 1e-6) & (table[None, :, :2] < high - 1e-6)).all(axis=2)
    joined = (ends[:, None, :, None] == ends[None, :, None, :]).any(axis=(2, 3))
    for i, j in np.argwhere(np.triu(near & ~joined, 1)):
        if not _is_own_room(names[i], names[j]):
            yield f"{names[i]}: too near to {names[j]}. Allowed: {2 * WALL_THICKNESS:g} m for two walls between them"


def _is_own_room(part: str, other: str) -> bool:
    return other.startswith(part + "/doors/")
