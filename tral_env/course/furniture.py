"""What stands in a corridor and in its walls: doors, cupboards, boxes, gates, signs, tape, as boxes and markers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tral_env.course.frames import TURNS, Frame, Rect, branch_width, stubs
from tral_env.course.layout import Door, Gate, Tape
from tral_env.geometry import MARKER_BOARD_WIDTH_M
from tral_env.interface import TURN_MARKER_IDS

WALL_THICKNESS = 0.15
"""Walls are this thick, m."""
HEIGHT = {"wall": 0.5, "door": 0.5, "frame": 0.5, "cupboard": 0.48, "obstacle": 0.35}
"""Boxes are this high, m: low enough for a chase camera to see over, far above the plane of the sonars."""
ROOM = 1.5
"""The room behind an open door is this deep and this wide, m."""
LEAF = 0.04
"""The leaf of an open door is this thick, m."""
FRAME_WIDTH = 0.06
"""A door frame covers this much of the wall on each side of its door, m."""
BOARD_THICKNESS = 0.03
"""Marker boards are this thick, m."""
SIGN_HEIGHT = 0.22
"""The middle of a turn marker hangs this far above the floor, m."""
SIGN_GAP = 0.03
"""A turn marker's board keeps this far from the opening or the step beside it, m."""
FACE_GAP = 0.002
"""A marker's face stands this far before its board or wall, m."""


class Box(NamedTuple):
    """One box on the floor."""

    kind: str
    """One of `tral_env.course.plan.BOX_KINDS`."""
    where: str
    """Its place in the course file, for error messages."""
    x: float
    """Its middle in the course frame, m."""
    y: float
    """Its middle in the course frame, m."""
    yaw: float
    """Its turn, counter-clockwise, rad."""
    length: float
    """Half its extent along its own x axis, m."""
    width: float
    """Half its extent along its own y axis, m."""
    height: float
    """Its whole height, m."""


@dataclass
class Space:
    """What a course is made of, gathered segment by segment."""

    floor: list[Rect] = field(default_factory=list)
    """Floor that has walls around it."""
    cut: list[Rect] = field(default_factory=list)
    """What is not wall inside the thickness of a wall: recesses, doorways, doors."""
    boxes: list[Box] = field(default_factory=list)
    """What stands on the floor and in doorways."""
    markers: list[tuple[int, float, float, float, float]] = field(default_factory=list)
    """Id, x, y, z of the face's middle, m, yaw of its normal, rad."""


def furnish(frames: list[Frame]) -> Space:
    """Gather the floor of a course and all that stands on it."""
    space = Space()
    for i, frame in enumerate(frames):
        _add_segment(space, f"/segments/{i}", frame, frames[(i + 1) % len(frames)])
    return space


def _add_segment(space: Space, where: str, frame: Frame, after: Frame) -> None:
    segment = frame.segment
    space.floor.append(frame.corridor)
    if segment.branches:
        for stub in stubs(frame, after):
            space.floor += [stub.rect, stub.throat]
    for k, door in enumerate(segment.doors):
        _add_door(space, f"{where}/doors/{k}", frame, door)
    for k, cupboard in enumerate(segment.cupboards):
        left = TURNS[cupboard.side] * (segment.width - cupboard.depth) / 2
        x, y = frame.point(cupboard.at, left)
        half = cupboard.length / 2, cupboard.depth / 2
        space.boxes.append(Box("obstacle", f"{where}/cupboards/{k}", x, y, frame.yaw, *half, HEIGHT["cupboard"]))
    for k, box in enumerate(segment.obstacles):
        x, y = frame.point(box.at, box.offset)
        yaw, half = frame.yaw + np.radians(box.yaw_deg), (box.length / 2, box.width / 2)
        space.boxes.append(Box("obstacle", f"{where}/obstacles/{k}", x, y, yaw, *half, HEIGHT["obstacle"]))
    for k, gate in enumerate(segment.gates):
        _add_gate(space, f"{where}/gates/{k}", frame, gate)
    if segment.branches and segment.sign:
        _add_sign(space, frame, after)


def _add_door(space: Space, where: str, frame: Frame, door: Door) -> None:
    """Cut the doorway out of the wall, and put the leaf and the frame into it."""
    sign, half, wall = TURNS[door.side], door.width / 2, frame.segment.width / 2

    def rect(along0: float, along1: float, deep0: float, deep1: float) -> Rect:
        return frame.rect(door.at + along0, door.at + along1, sign * (wall + deep0), sign * (wall + deep1))

    space.cut.append(rect(-half, half, 0.0, WALL_THICKNESS))
    if door.open:
        space.floor.append(rect(-ROOM / 2, ROOM / 2, WALL_THICKNESS, WALL_THICKNESS + ROOM))
        x, y = frame.point(door.at + half + LEAF / 2, sign * (wall + WALL_THICKNESS + half))
        space.boxes.append(Box("door", where, x, y, frame.yaw, LEAF / 2, half, HEIGHT["door"]))
    else:
        x, y = frame.point(door.at, sign * (wall + (door.recess + WALL_THICKNESS) / 2))
        thickness = WALL_THICKNESS - door.recess
        space.boxes.append(Box("door", where, x, y, frame.yaw, half, thickness / 2, HEIGHT["door"]))
    if door.frame > 0:
        for end in (-half - FRAME_WIDTH / 2, half + FRAME_WIDTH / 2):
            x, y = frame.point(door.at + end, sign * (wall - door.frame / 2))
            space.boxes.append(Box("frame", where, x, y, frame.yaw, FRAME_WIDTH / 2, door.frame / 2, HEIGHT["frame"]))


def _add_gate(space: Space, where: str, frame: Frame, gate: Gate) -> None:
    """Put up the left board and the right one; their markers face the car that comes."""
    x, y = frame.point(gate.at, gate.offset)
    yaw = frame.yaw + np.radians(gate.yaw_deg)
    ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    out, height = (gate.width + MARKER_BOARD_WIDTH_M) / 2, gate.marker_height + MARKER_BOARD_WIDTH_M / 2
    for k, sign in enumerate((1, -1)):
        board = np.array([x, y]) + sign * out * left
        face = board - (BOARD_THICKNESS / 2 + FACE_GAP) * ahead
        space.boxes.append(
            Box(
                "post",
                where,
                float(board[0]),
                float(board[1]),
                yaw,
                BOARD_THICKNESS / 2,
                MARKER_BOARD_WIDTH_M / 2,
                height,
            )
        )
        space.markers.append((2 * gate.id + k, *face, gate.marker_height, yaw + np.pi))


def _add_sign(space: Space, frame: Frame, after: Frame) -> None:
    """Hang the marker on the wall ahead, beside the way straight on if there is one."""
    segment = frame.segment
    ways = {str(branch.to): branch_width(branch, segment, after.segment) for branch in segment.branches}
    ways[segment.then] = after.segment.width
    side = segment.then if segment.then != "straight" else ("left" if "left" in ways else "right")
    if "straight" in ways:
        far, left = ways[side] / 2, TURNS[side] * (ways["straight"] / 2 + MARKER_BOARD_WIDTH_M / 2 + SIGN_GAP)
    else:
        # A wider branch opposite makes a step in the wall ahead, in the middle.
        far, left = (
            ways[side] / 2,
            TURNS[side] * (0.0 if max(ways.values()) == ways[side] else MARKER_BOARD_WIDTH_M / 2 + SIGN_GAP),
        )
    x, y = frame.point(segment.length + far - FACE_GAP, left)
    space.markers.append((TURN_MARKER_IDS[segment.then], x, y, SIGN_HEIGHT, frame.yaw + np.pi))


def tape_line(frame: Frame, tape: Tape) -> Rect:
    """Middle line of a strip of tape: x0, y0, x1, y1, m."""
    half = tape.length / 2
    along, left = (0.0, half) if tape.across else (half, 0.0)
    ends = (frame.point(tape.at - along, tape.offset - left), frame.point(tape.at + along, tape.offset + left))
    return (*ends[0], *ends[1])
