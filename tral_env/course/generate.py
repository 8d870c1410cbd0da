"""Seeded courses: families, each a way to draw a `Course` from a random generator."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from tral_env.course.frames import Frame, place_segments
from tral_env.course.furniture import FRAME_WIDTH
from tral_env.course.geometry import build_plan, overlap_problems
from tral_env.course.layout import Course
from tral_env.course.overlap import level_half
from tral_env.course.plan import Plan
from tral_env.errors import ConfigError, CourseError, nearest
from tral_env.interface import STRONG_GATES

Draft = dict[str, Any]
"""Members of a course, or of one of its parts, before they are checked."""

Sketch = Callable[[np.random.Generator, bool], Draft]
"""Draws the members of a course: its segments with what stands in them. True: the gates may be hard."""


@dataclass(frozen=True, kw_only=True)
class Family:
    """A way to draw courses."""

    meaning: str
    sketch: Sketch
    max_boxes: int
    """A draft with more boxes is dropped. A straight corridor has 4 boxes, and each obstacle and cupboard adds 1. A
    small limit makes the physics fast, since every car of a batch carries as many."""
    max_markers: int
    """A draft with more markers is dropped. A gate has 2 markers, a crossing has 1."""


ATTEMPTS = 200
"""The generator gives up when this many drafts have failed; a few in a hundred fail."""
JOIN_ATTEMPTS = 1000
"""A draft fails when this many ways to join its segments have failed."""
START_AT = 1.0
"""The car starts this far from the first wall, m."""
GOAL_BEFORE_END = 1.0
"""The goal line lies this far before the end wall, m."""
RUN_IN = 2.5
"""Nothing stands in the way within this distance after the start, m."""
RUN_OUT = 1.0
"""Nothing stands in the way within this distance before the goal, m."""
CORNER_ROOM = 1.9
"""Gates, boxes and cupboards keep this far from the ends of a segment's plain part, m."""
HARD_CORNER_ROOM = 0.8
"""Gates of hard courses keep this far from a corner, m."""
FIRST_GATE = 3.5
"""The first gate stands at least this far after the start, m."""
GATES_APART = 4.0
"""Two gates of a segment are at least this far apart, m."""
BOARD_ROOM = 0.25
"""A gate's opening keeps this far from the wall, where its board stands, m."""
PASSAGE = 0.7
"""A box leaves a passage of this width on one side at least, m."""


def generate(scenario: str, rng: np.random.Generator, *, hard: bool = False) -> Course:
    """Draw a course.

    Args:
        scenario: one of `FAMILIES`.
        rng: source of all randomness; the same state gives the same course.
        hard: gates may stand right behind a corner, and where there is a wall on one side only.

    Raises:
        ConfigError: no such scenario.
        CourseError: no draft could be driven, see `draw`.
    """
    return generate_plan(scenario, rng, hard=hard)[0]


def generate_plan(scenario: str, rng: np.random.Generator, *, hard: bool = False) -> tuple[Course, Plan]:
    """Draw a course as `generate` does, and give its plan with it, which shows that the car can drive it.

    Raises:
        ConfigError: no such scenario.
        CourseError: no draft could be driven, see `draw`.
    """
    if scenario not in FAMILIES:
        raise ConfigError(f"unknown scenario '{scenario}': {nearest(scenario, FAMILIES)}")
    return draw(scenario, FAMILIES[scenario], rng, hard=hard)


def draw(name: str, family: Family, rng: np.random.Generator, *, hard: bool = False) -> tuple[Course, Plan]:
    """Draw drafts of a family until one can be driven, and give it with its plan.

    Raises:
        CourseError: none of `ATTEMPTS` drafts can be driven; the message tells the most frequent cause.
    """
    causes: list[str] = []
    for _ in range(ATTEMPTS):
        try:
            draft = family.sketch(rng, hard)
            course = Course.model_validate({"name": name, "start": _start(rng, draft), **draft})
            plan = build_plan(course)
        except CourseError as error:
            causes.append(str(error))
            continue
        if len(plan.box_kind) <= family.max_boxes and len(plan.marker_id) <= family.max_markers:
            return course, plan
        causes.append(
            f"{len(plan.box_kind)} boxes and {len(plan.marker_id)} markers, where the family allows "
            f"{family.max_boxes} and {family.max_markers}"
        )
    raise CourseError(f"no drivable course of '{name}' in {ATTEMPTS} drafts. {_most_frequent(causes)}")


def _most_frequent(causes: list[str]) -> str:
    """Tell how often the most frequent cause came, and its first text; causes that differ in numbers alone are one."""
    kinds = [re.sub(r"-?\d+(\.\d+)?", "#", cause) for cause in causes]
    (kind, count), *_ = Counter(kinds).most_common(1)
    return f"The most frequent cause, in {count} drafts: {causes[kinds.index(kind)]}"


def _uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number from [low, high), in whole millimetres so that course files stay readable."""
    # The numbers of rng.uniform, at a third of its cost.
    return round(low + (max(low, high) - low) * rng.random(), 3)


def _width(rng: np.random.Generator) -> float:
    return _uniform(rng, 1.6, 2.6)


def _side(rng: np.random.Generator) -> str:
    return "left" if rng.random() < 0.5 else "right"


def _start(rng: np.random.Generator, draft: Draft) -> Draft:
    first = draft["segments"][0]
    sixth = first["width"] / 6
    at = round(first["length"] / 2, 3) if draft.get("closed") else START_AT
    return {"at": at, "offset": _uniform(rng, -sixth, sixth), "heading_deg": round(float(rng.uniform(-5, 5)), 2)}


def _straight(rng: np.random.Generator, _: bool) -> Draft:
    return {"segments": [{"length": _uniform(rng, 12, 20), "width": _width(rng)}]}


def _doors(rng: np.random.Generator, _: bool) -> Draft:
    segment: Draft = {"length": _uniform(rng, 12, 20), "width": _width(rng)}
    segment["doors"] = [*_draw_doors(rng, 0.0, segment["length"])]
    return {"segments": [segment]}


def _draw_doors(rng: np.random.Generator, begin: float, end: float) -> Iterator[Draft]:
    """Draw doors on both sides between two places along a segment."""
    for side in ("left", "right"):
        at = begin + _uniform(rng, 0.6, 3.0)
        while True:
            width = _uniform(rng, 0.8, 1.0)
            if at + width / 2 + FRAME_WIDTH > end:
                break
            yield {
                "side": side,
                "at": round(at, 3),
                "width": width,
                "recess": _uniform(rng, 0.03, 0.1),
                "frame": _uniform(rng, 0.02, 0.04),
                "open": bool(rng.random() < 0.1),
            }
            at += _uniform(rng, 2, 5)


def _corners(rng: np.random.Generator, _: bool) -> Draft:
    count = int(rng.integers(3, 6))
    segments = [{"length": _uniform(rng, 3, 8), "width": _width(rng)} for _ in range(count)]
    return {"segments": _join_by_corners(rng, segments)}


def _join_by_corners(rng: np.random.Generator, segments: list[Draft]) -> list[Draft]:
    """Join segments by corners, each left or right by chance; a course that meets itself is dropped later."""
    turns = [_side(rng) for _ in segments[:-1]]
    return [*({**s, "then": turn} for s, turn in zip(segments, turns, strict=False)), segments[-1]]


def _loop(rng: np.random.Generator, _: bool) -> Draft:
    sides = (_uniform(rng, 6, 12), _uniform(rng, 6, 12))
    turn = _side(rng)
    segments = [{"length": sides[i % 2], "width": _width(rng), "then": turn} for i in range(4)]
    return {"segments": segments, "closed": True}


def _lane_change(rng: np.random.Generator, _: bool) -> Draft:
    segment: Draft = {"length": _uniform(rng, 12, 20), "width": _width(rng)}
    begin, end = START_AT + RUN_IN, segment["length"] - GOAL_BEFORE_END - RUN_OUT
    segment["cupboards"] = [*_draw_cupboards(rng, begin, end)]
    return {"segments": [segment]}


def _draw_cupboards(rng: np.random.Generator, begin: float, end: float) -> Iterator[Draft]:
    """Draw cupboards one behind the other, each at a wall drawn by chance."""
    at = begin + _uniform(rng, 0.0, 2.0)
    while True:
        length = _uniform(rng, 1.5, 4)
        if at + length > end:
            return
        yield {
            "side": _side(rng),
            "at": round(at + length / 2, 3),
            "length": length,
            "depth": _uniform(rng, 0.3, 0.6),
        }
        at += length + _uniform(rng, 2.5, 5)


def _obstacles(rng: np.random.Generator, _: bool) -> Draft:
    segment: Draft = {"length": _uniform(rng, 12, 20), "width": _width(rng)}
    begin, end = START_AT + RUN_IN, segment["length"] - GOAL_BEFORE_END - RUN_OUT
    segment["obstacles"] = [*_draw_obstacles(rng, begin, end, segment["width"], int(rng.integers(1, 5)))]
    return {"segments": [segment]}


def _places(rng: np.random.Generator, begin: float, end: float, count: int, apart: float) -> list[float]:
    """Draw up to `count` places between begin and end, at least `apart` from each other, uniform among all such."""
    count = min(count, int((end - begin) // apart) + 1) if end > begin else 0
    spare = end - begin - apart * (count - 1)
    slack = sorted(max(spare, 0.0) * rng.random() for _ in range(count))
    return [round(begin + apart * k + extra, 3) for k, extra in enumerate(slack)]


def _draw_obstacles(rng: np.random.Generator, begin: float, end: float, width: float, count: int) -> Iterator[Draft]:
    """Draw boxes that leave a way past them."""
    for at in _places(rng, begin, end, count, 3.4):
        length, across = _uniform(rng, 0.2, 0.4), _uniform(rng, 0.2, 0.4)
        yaw_deg = round(float(rng.uniform(-45, 45)), 1)
        yaw = math.radians(yaw_deg)
        _, half = level_half(length / 2, across / 2, math.cos(yaw), math.sin(yaw))
        room = width / 2 - half
        offset = _uniform(rng, -room, room)
        if width / 2 + abs(offset) - half < PASSAGE:
            offset = round(math.copysign(PASSAGE + half - width / 2 + 0.001, offset), 3)
        yield {"at": at, "offset": offset, "length": length, "width": across, "yaw_deg": yaw_deg}


def _gates(rng: np.random.Generator, hard: bool) -> Draft:
    count = int(rng.integers(1, 4))
    if hard and rng.random() < 0.5:
        return _gate_at_opening(rng)
    if rng.random() < 0.5:
        width = _width(rng)
        needed = START_AT + FIRST_GATE + GATES_APART * (count - 1) + RUN_OUT + GOAL_BEFORE_END
        length = _uniform(rng, max(12.0, needed), max(20.0, needed))
        gates = _draw_gates(rng, START_AT + FIRST_GATE, length - GOAL_BEFORE_END - RUN_OUT, width, count, 0)
        return {"segments": [{"length": length, "width": width, "gates": [*gates]}]}
    before: Draft = {"length": _uniform(rng, 6, 10), "width": _width(rng), "then": _side(rng)}
    after: Draft = {"length": _uniform(rng, 7, 12), "width": _width(rng)}
    end = before["length"] - after["width"] / 2 - CORNER_ROOM
    before["gates"] = [*_draw_gates(rng, START_AT + FIRST_GATE, end, before["width"], min(1, count - 1), 0)]
    begin = before["width"] / 2 + (HARD_CORNER_ROOM if hard else CORNER_ROOM)
    end = begin + 0.5 if hard else after["length"] - GOAL_BEFORE_END - RUN_OUT
    first = len(before["gates"])
    after["gates"] = [*_draw_gates(rng, begin, end, after["width"], count - first, first)]
    return {"segments": [before, after]}


def _gate_at_opening(rng: np.random.Generator) -> Draft:
    """Draw a gate where a wide branch leaves a wall on one side only; the car goes straight on."""
    width, opening = _width(rng), _uniform(rng, 2.4, 4)
    before: Draft = {"length": _uniform(rng, 7, 10), "width": width, "then": "straight", "sign": False}
    before["branches"] = [{"to": _side(rng), "length": _uniform(rng, 1, 3), "width": opening}]
    middle = before["length"] - opening / 4
    before["gates"] = [*_draw_gates(rng, middle - 0.2, middle, width, 1, 0)]
    return {"segments": [before, {"length": _uniform(rng, 5, 10), "width": width}]}


def _draw_gates(
    rng: np.random.Generator, begin: float, end: float, width: float, count: int, first: int
) -> Iterator[Draft]:
    for k, at in enumerate(_places(rng, begin, end, count, GATES_APART)):
        inner = _uniform(rng, 0.6, min(1.2, width - 2 * BOARD_ROOM))
        room = (width - inner) / 2 - BOARD_ROOM
        yield {
            "id": STRONG_GATES[first + k],
            "at": at,
            "offset": _uniform(rng, -room, room),
            "width": inner,
            "yaw_deg": round(float(rng.uniform(-10, 10)), 1),
            "marker_height": _uniform(rng, 0.15, 0.3),
        }


def _crossing(rng: np.random.Generator, _: bool) -> Draft:
    count = int(rng.integers(1, 4))
    segments: list[Draft] = [{"length": _uniform(rng, 5, 8), "width": _width(rng)} for _ in range(count + 1)]
    for segment, after in pairwise(segments):
        _open_crossing(rng, segment, after)
    return {"segments": segments}


def _open_crossing(rng: np.random.Generator, segment: Draft, after: Draft) -> None:
    """Make the end of a segment a T or an X crossing, and draw the way on."""
    ways = ["left", "right", "straight"]
    if rng.random() < 0.5:
        ways.pop(rng.integers(len(ways)))
    segment["then"] = ways[rng.integers(len(ways))]
    if segment["then"] == "straight":
        after["width"] = segment["width"]
    across = after["width"] if segment["then"] != "straight" else _width(rng)
    segment["branches"] = [
        {
            "to": way,
            "length": _uniform(rng, 2, 4),
            "width": segment["width"] if way == "straight" else across,
        }
        for way in ways
        if way != segment["then"]
    ]


def _office(rng: np.random.Generator, hard: bool) -> Draft:
    target = _uniform(rng, 25, 60)
    segments: list[Draft] = []
    while (length := sum(s["length"] for s in segments)) < target - 4.0:
        left = target - length
        length = _uniform(rng, 5, 11)
        segments.append({"length": round(left, 3) if left - length < 4.0 else length, "width": _width(rng)})
    gates = 0
    for i, (frame, segment) in enumerate(zip(_join_without_overlap(rng, segments), segments, strict=True)):
        begin = START_AT + RUN_IN if i == 0 else frame.clear_from
        end = frame.clear_to - (GOAL_BEFORE_END if i == len(segments) - 1 else 0.0)
        if i % len(_FURNITURE) == 0:
            order = rng.permutation(len(_FURNITURE))
        what = _FURNITURE[order[i % len(_FURNITURE)]]
        if what != "cupboards" and rng.random() < 0.6:
            segment["doors"] = [*_draw_doors(rng, begin, end)]
        gates += _furnish(rng, segment, what, begin + (1.0 if i == 0 else CORNER_ROOM), end - CORNER_ROOM, gates)
    return {"segments": segments}


_FURNITURE = ("cupboards", "obstacles", "gate", "nothing")
"""One of these stands in each segment of an office."""


def _join_without_overlap(rng: np.random.Generator, segments: list[Draft]) -> list[Frame]:
    """Join segments by corners and crossings until no part comes too near to another, and give their frames.

    Raises:
        CourseError: no way of `JOIN_ATTEMPTS` leaves each part its room.
    """
    for _ in range(JOIN_ATTEMPTS):
        for segment, after in pairwise(segments):
            segment.pop("branches", None)
            if rng.random() < 0.35:
                _open_crossing(rng, segment, after)
            else:
                segment["then"] = _side(rng)
        bare = Course.model_validate({"name": "bare", "segments": segments})
        frames = place_segments(bare)
        if not any(overlap_problems(bare, frames)):
            return frames
    raise CourseError(
        f"{len(segments)} segments could not be joined in {JOIN_ATTEMPTS} ways without one coming too near to another"
    )


def _furnish(rng: np.random.Generator, segment: Draft, what: str, begin: float, end: float, gates: int) -> int:
    """Put cupboards, boxes or gate number `gates` into a segment, and give the number of gates in it."""
    if what == "cupboards":
        segment["cupboards"] = [*_draw_cupboards(rng, begin, end)]
    elif what == "obstacles":
        segment["obstacles"] = [*_draw_obstacles(rng, begin, end, segment["width"], int(rng.integers(1, 3)))]
    elif what == "gate":
        segment["gates"] = [*_draw_gates(rng, begin, end, segment["width"], 1, gates)]
    return len(segment.get("gates", ()))


FAMILIES: Mapping[str, Family] = {
    "straight": Family(
        meaning="one straight corridor, 12 to 20 m",
        sketch=_straight,
        max_boxes=4,
        max_markers=0,
    ),
    "doors": Family(
        meaning="a straight corridor with recessed doors on both sides, one in ten open",
        sketch=_doors,
        max_boxes=72,
        max_markers=0,
    ),
    "corners": Family(
        meaning="3 to 5 segments joined by 90 degree corners",
        sketch=_corners,
        max_boxes=12,
        max_markers=0,
    ),
    "loop": Family(
        meaning="a ring of corridors, driven once around",
        sketch=_loop,
        max_boxes=8,
        max_markers=0,
    ),
    "lane_change": Family(
        meaning="a straight corridor with cupboards along its walls",
        sketch=_lane_change,
        max_boxes=8,
        max_markers=0,
    ),
    "obstacles": Family(
        meaning="a straight corridor with 1 to 4 boxes in the way",
        sketch=_obstacles,
        max_boxes=8,
        max_markers=0,
    ),
    "gates": Family(
        meaning="1 to 3 ArUco gates in a straight corridor or around a corner",
        sketch=_gates,
        max_boxes=16,
        max_markers=6,
    ),
    "crossing": Family(
        meaning="1 to 3 T or X crossings; a marker tells the turn",
        sketch=_crossing,
        max_boxes=28,
        max_markers=3,
    ),
    "office": Family(
        meaning="25 to 60 m of everything: corners, crossings, doors, cupboards, boxes, gates",
        sketch=_office,
        max_boxes=120,
        max_markers=12,
    ),
}
"""The families of courses by name. To add one: docs/extending.md."""
SCENARIOS: Mapping[str, str] = {name: family.meaning for name, family in FAMILIES.items()}
"""Families of courses: name -> what they are."""
