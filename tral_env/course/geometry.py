"""From a course to boxes: walls without gaps or overlaps, doors, frames, obstacles, marker boards.

The floor is a union of rectangles; `walls.cut_walls` puts walls around it, `furniture` puts things on it, `route` lays
the line through it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np

from tral_env.course import route as routes
from tral_env.course.drivable import check_drivable
from tral_env.course.frames import TURNS, Frame, Rect, place_segments, stubs
from tral_env.course.furniture import (
    FRAME_WIDTH,
    HEIGHT,
    ROOM,
    WALL_THICKNESS,
    Box,
    Space,
    furnish,
    tape_line,
)
from tral_env.course.layout import Course, Door
from tral_env.course.overlap import overlapping
from tral_env.course.plan import BOX_KINDS, Plan, place_on
from tral_env.course.walls import cut_walls
from tral_env.errors import CourseError, problem_report
from tral_env.geometry import MARKER_BOARD_WIDTH_M

_KIND = {kind: i for i, kind in enumerate(BOX_KINDS)}


def build_plan(course: Course) -> Plan:
    """Work out the geometry of a course.

    Raises:
        CourseError: parts do not fit together, overlap, or leave the car no way; all problems with their places.
    """
    frames = place_segments(course.checked())
    problems = list(_fit_problems(course, frames))
    route = routes.plan_route(course, frames, problems)
    _raise_if(course, problems)
    space = furnish(frames)
    boxes = _boxes(space)
    arrays = _box_arrays(boxes)
    _raise_if(course, list(_collisions(boxes, arrays)))
    gates = [(frame, gate) for frame in frames for gate in frame.segment.gates]
    gate_pose = np.array(
        [(*frame.point(gate.at, gate.offset), frame.yaw + np.radians(gate.yaw_deg)) for frame, gate in gates]
    ).reshape(-1, 3)
    # Not simply segment by segment: a ring begins at the start, amid its first segment.
    order = [*range(len(gates))] if len(gates) < 2 else np.argsort(place_on(route, gate_pose[:, :2]), kind="stable")
    start = course.start
    plan = Plan(
        **arrays,
        route=route,
        start=np.array([*frames[0].point(start.at, start.offset), np.radians(start.heading_deg)]),
        gate_pose=gate_pose[order],
        gate_width=np.array([gate.width for _, gate in gates], float)[order],
        gate_id=np.array([gate.id for _, gate in gates], np.int64)[order],
        marker_position=np.array([marker[1:4] for marker in space.markers], float).reshape(-1, 3),
        marker_yaw=np.array([marker[4] for marker in space.markers], float),
        marker_id=np.array([marker[0] for marker in space.markers], np.int64),
        tape=np.array([tape_line(frame, tape) for frame in frames for tape in frame.segment.tapes], float).reshape(
            -1, 4
        ),
        straights=routes.straights(frames),
        laps=course.laps,
    )
    check_drivable(plan, course.name)
    return plan


def _raise_if(course: Course, problems: list[str]) -> None:
    if problems:
        raise CourseError(problem_report(f"course '{course.name}'", problems))


def _boxes(space: Space) -> list[Box]:
    walls = [
        Box("wall", "a wall", (x0 + x1) / 2, (y0 + y1) / 2, 0.0, (x1 - x0) / 2, (y1 - y0) / 2, HEIGHT["wall"])
        for x0, y0, x1, y1 in cut_walls(space.floor, space.cut, WALL_THICKNESS)
    ]
    return walls + space.boxes


def _box_arrays(boxes: list[Box]) -> dict[str, Any]:
    numbers = itertools.chain.from_iterable(box[2:] for box in boxes)
    table = np.fromiter(numbers, float, 6 * len(boxes)).reshape(-1, 6)
    position, size = np.empty((2, len(boxes), 3))
    position[:, :2], size[:, :2] = table[:, :2], table[:, 3:5]
    position[:, 2] = size[:, 2] = table[:, 5] / 2
    kind = np.array([_KIND[box.kind] for box in boxes], np.int64)
    return {"box_kind": kind, "box_position": position, "box_yaw": table[:, 2], "box_size": size}


def _collisions(boxes: list[Box], arrays: dict[str, Any]) -> Iterator[str]:
    """Tell which things stand in each other or in a wall; walls never overlap each other."""
    first = sum(box.kind == "wall" for box in boxes)
    pairs = overlapping(arrays["box_position"][:, :2], arrays["box_yaw"], arrays["box_size"][:, :2], first)
    told = {(boxes[i].where, boxes[j].where): (boxes[i].x, boxes[i].y) for i, j in pairs}
    for (where, other), (x, y) in told.items():
        yield f"{where}: overlaps {other} at ({x:.2f}, {y:.2f})"


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
    for side in ("left", "right"):
        row = sorted(((k, door) for k, door in enumerate(segment.doors) if door.side == side), key=_place)
        for (_, door), (k, after) in itertools.pairwise(row):
            low = door.at + (door.width + after.width) / 2 + 2 * FRAME_WIDTH
            if after.at < low - 1e-9:
                yield f"{where}/doors/{k}/at: got {after.at:g}, beside a door at {door.at:g}. Allowed: {low:g} or more"
    for k, cupboard in enumerate(segment.cupboards):
        low, high = frame.clear_from + cupboard.length / 2, frame.clear_to - cupboard.length / 2
        if not low <= cupboard.at <= high:
            yield f"{where}/cupboards/{k}/at: got {cupboard.at:g}. Allowed: {low:g} to {high:g}, between corners"
    for k, gate in enumerate(segment.gates):
        room = (segment.width - gate.width) / 2 - MARKER_BOARD_WIDTH_M
        if abs(gate.offset) > room + 1e-9:
            boards = f"boards of {MARKER_BOARD_WIDTH_M:g} m"
            got = f"{boards} beside a gate of {gate.width:g} m, {gate.offset:g} m off the middle"
            yield f"{where}/gates/{k}: {got}, stick in the wall. Allowed: offset within {room:g}"


def overlap_problems(course: Course, frames: list[Frame]) -> Iterator[str]:
    """Tell which parts that are not neighbours leave no room for two walls between them."""
    walls = 2 * WALL_THICKNESS
    apart = walls - 1e-6
    parts = list(_parts(course, frames))
    for i, (name, (x0, y0, x1, y1), begin, end) in enumerate(parts):
        x0, y0, x1, y1 = x0 - apart, y0 - apart, x1 + apart, y1 + apart
        for other, rect, *ends in parts[i + 1 :]:
            if rect[0] >= x1 or rect[2] <= x0 or rect[1] >= y1 or rect[3] <= y0:
                continue
            if begin not in ends and end not in ends and not _is_own_room(name, other):
                yield f"{name}: too near to {other}. Allowed: {walls:g} m for two walls between them"


def _parts(course: Course, frames: list[Frame]) -> Iterator[tuple[str, Rect, int, int]]:
    """Corridors, branches and rooms: place in the course file, floor, and the nodes where they begin and end.

    Parts that share a node are neighbours. A room has a node of its own, so that two rooms are none.
    """
    count = len(frames)
    room_nodes = itertools.count(-1, -1)  # those of segments count up from 0
    for i, frame in enumerate(frames):
        where, on = f"/segments/{i}", (i + 1) % count if course.closed else i + 1
        yield where, frame.corridor, i, on
        if frame.segment.branches:
            for k, stub in enumerate(stubs(frame, frames[(i + 1) % count])):
                yield f"{where}/branches/{k}", stub.rect, on, on
        for k, door in enumerate(frame.segment.doors):
            if door.open:
                wall = TURNS[door.side] * (frame.segment.width / 2 + WALL_THICKNESS)
                room = frame.rect(door.at - ROOM / 2, door.at + ROOM / 2, wall, wall + TURNS[door.side] * ROOM)
                node = next(room_nodes)
                yield f"{where}/doors/{k}", room, node, node


def _is_own_room(part: str, other: str) -> bool:
    """Whether the other part is a room behind a door of this one."""
    return other.startswith(part + "/doors/")


def _place(numbered: tuple[int, Door]) -> float:
    return numbered[1].at
