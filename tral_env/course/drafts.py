"""What families of courses are drawn of: doors, cupboards, boxes, gates, crossings, each as a draft by chance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from tral_env.course.frames import Frame, place_segments
from tral_env.course.furniture import FRAME_WIDTH
from tral_env.course.geometry import overlap_problems
from tral_env.course.layout import Course
from tral_env.course.overlap import level_half
from tral_env.errors import CourseError
from tral_env.interface import STRONG_GATES

Draft = dict[str, Any]
"""Members of a course, or of one of its parts, before they are checked."""
JOIN_ATTEMPTS = 1000
"""A draft fails when this many ways to join its segments have failed."""
GATES_APART = 4.0
"""Two gates of a segment are at least this far apart, m."""
BOARD_ROOM = 0.25
"""A gate's opening keeps this far from the wall, where its board stands, m."""
PASSAGE = 0.7
"""A box leaves a passage of this width on one side at least, m."""


def uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number from [low, high), in whole millimetres so that course files stay readable."""
    # The numbers of rng.uniform, at a third of its cost.
    return round(low + (max(low, high) - low) * rng.random(), 3)


def any_width(rng: np.random.Generator) -> float:
    """Draw the width of a corridor, m."""
    return uniform(rng, 1.6, 2.6)


def any_side(rng: np.random.Generator) -> str:
    """Draw "left" or "right"."""
    return "left" if rng.random() < 0.5 else "right"


def _places(rng: np.random.Generator, begin: float, end: float, count: int, apart: float) -> list[float]:
    """Draw up to `count` places between begin and end, at least `apart` from each other, uniform among all such."""
    count = min(count, int((end - begin) // apart) + 1) if end > begin else 0
    spare = end - begin - apart * (count - 1)
    slack = sorted(max(spare, 0.0) * rng.random() for _ in range(count))
    return [round(begin + apart * k + extra, 3) for k, extra in enumerate(slack)]


def draw_doors(rng: np.random.Generator, begin: float, end: float) -> Iterator[Draft]:
    """Draw doors on both sides between two places along a segment."""
    for side in ("left", "right"):
        at = begin + uniform(rng, 0.6, 3.0)
        while True:
            width = uniform(rng, 0.8, 1.0)
            if at + width / 2 + FRAME_WIDTH > end:
                break
            yield {
                "side": side,
                "at": round(at, 3),
                "width": width,
                "recess": uniform(rng, 0.03, 0.1),
                "frame": uniform(rng, 0.02, 0.04),
                "open": bool(rng.random() < 0.1),
            }
            at += uniform(rng, 2, 5)


def draw_cupboards(rng: np.random.Generator, begin: float, end: float) -> Iterator[Draft]:
    """Draw cupboards one behind the other, each at a wall drawn by chance."""
    at = begin + uniform(rng, 0.0, 2.0)
    while True:
        length = uniform(rng, 1.5, 4)
        if at + length > end:
            return
        yield {
            "side": any_side(rng),
            "at": round(at + length / 2, 3),
            "length": length,
            "depth": uniform(rng, 0.3, 0.6),
        }
        at += length + uniform(rng, 2.5, 5)


def draw_obstacles(rng: np.random.Generator, begin: float, end: float, width: float, count: int) -> Iterator[Draft]:
    """Draw boxes that leave a way past them."""
    for at in _places(rng, begin, end, count, 3.4):
        length, across = uniform(rng, 0.2, 0.4), uniform(rng, 0.2, 0.4)
        yaw_deg = round(float(rng.uniform(-45, 45)), 1)
        yaw = math.radians(yaw_deg)
        _, half = level_half(length / 2, across / 2, math.cos(yaw), math.sin(yaw))
        room = width / 2 - half
        offset = uniform(rng, -room, room)
        if width / 2 + abs(offset) - half < PASSAGE:
            offset = round(math.copysign(PASSAGE + half - width / 2 + 0.001, offset), 3)
        yield {"at": at, "offset": offset, "length": length, "width": across, "yaw_deg": yaw_deg}


def draw_gates(
    rng: np.random.Generator, begin: float, end: float, width: float, count: int, first: int
) -> Iterator[Draft]:
    """Draw up to `count` gates between two places of a corridor of this width; `STRONG_GATES` gives their ids."""
    for k, at in enumerate(_places(rng, begin, end, count, GATES_APART)):
        inner = uniform(rng, 0.6, min(1.2, width - 2 * BOARD_ROOM))
        room = (width - inner) / 2 - BOARD_ROOM
        yield {
            "id": STRONG_GATES[first + k],
            "at": at,
            "offset": uniform(rng, -room, room),
            "width": inner,
            "yaw_deg": round(float(rng.uniform(-10, 10)), 1),
            "marker_height": uniform(rng, 0.15, 0.3),
        }


def open_crossing(rng: np.random.Generator, segment: Draft, after: Draft) -> None:
    """Make the end of a segment a T or an X crossing, and draw the way on."""
    ways = ["left", "right", "straight"]
    if rng.random() < 0.5:
        ways.pop(rng.integers(len(ways)))
    segment["then"] = ways[rng.integers(len(ways))]
    if segment["then"] == "straight":
        after["width"] = segment["width"]
    across = after["width"] if segment["then"] != "straight" else any_width(rng)
    segment["branches"] = [
        {
            "to": way,
            "length": uniform(rng, 2, 4),
            "width": segment["width"] if way == "straight" else across,
        }
        for way in ways
        if way != segment["then"]
    ]


def join_by_corners(rng: np.random.Generator, segments: list[Draft]) -> list[Draft]:
    """Join segments by corners, each left or right by chance; a course that meets itself is dropped later."""
    turns = [any_side(rng) for _ in segments[:-1]]
    return [*({**s, "then": turn} for s, turn in zip(segments, turns, strict=False)), segments[-1]]


def join_without_overlap(rng: np.random.Generator, segments: list[Draft]) -> list[Frame]:
    """Join segments by corners and crossings until no part comes too near to another, and give their frames.

    Raises:
        CourseError: no way of `JOIN_ATTEMPTS` leaves each part its room.
    """
    for _ in range(JOIN_ATTEMPTS):
        for segment, after in pairwise(segments):
            segment.pop("branches", None)
            if rng.random() < 0.35:
                open_crossing(rng, segment, after)
            else:
                segment["then"] = any_side(rng)
        bare = Course.model_validate({"name": "bare", "segments": segments})
        frames = place_segments(bare)
        if not any(overlap_problems(bare, frames)):
            return frames
    raise CourseError(
        f"{len(segments)} segments could not be joined in {JOIN_ATTEMPTS} ways without one coming too near to another"
    )
