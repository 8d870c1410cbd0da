"""Families of courses: each is a way to draw one. To add a family: docs/extending.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tral_env.course.drafts import (
    GATES_APART,
    Draft,
    any_side,
    any_width,
    draw_cupboards,
    draw_doors,
    draw_gates,
    draw_obstacles,
    join_by_corners,
    join_without_overlap,
    open_crossing,
    uniform,
)

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


def _straight(rng: np.random.Generator, _: bool) -> Draft:
    return {"segments": [{"length": uniform(rng, 12, 20), "width": any_width(rng)}]}


def _doors(rng: np.random.Generator, _: bool) -> Draft:
    segment: Draft = {"length": uniform(rng, 12, 20), "width": any_width(rng)}
    segment["doors"] = [*draw_doors(rng, 0.0, segment["length"])]
    return {"segments": [segment]}


def _corners(rng: np.random.Generator, _: bool) -> Draft:
    count = int(rng.integers(3, 6))
    segments = [{"length": uniform(rng, 3, 8), "width": any_width(rng)} for _ in range(count)]
    return {"segments": join_by_corners(rng, segments)}


def _loop(rng: np.random.Generator, _: bool) -> Draft:
    sides = (uniform(rng, 6, 12), uniform(rng, 6, 12))
    turn = any_side(rng)
    segments = [{"length": sides[i % 2], "width": any_width(rng), "then": turn} for i in range(4)]
    return {"segments": segments, "closed": True}


def _lane_change(rng: np.random.Generator, _: bool) -> Draft:
    segment: Draft = {"length": uniform(rng, 12, 20), "width": any_width(rng)}
    begin, end = START_AT + RUN_IN, segment["length"] - GOAL_BEFORE_END - RUN_OUT
    segment["cupboards"] = [*draw_cupboards(rng, begin, end)]
    return {"segments": [segment]}


def _obstacles(rng: np.random.Generator, _: bool) -> Draft:
    segment: Draft = {"length": uniform(rng, 12, 20), "width": any_width(rng)}
    begin, end = START_AT + RUN_IN, segment["length"] - GOAL_BEFORE_END - RUN_OUT
    segment["obstacles"] = [*draw_obstacles(rng, begin, end, segment["width"], int(rng.integers(1, 5)))]
    return {"segments": [segment]}


def _gates(rng: np.random.Generator, hard: bool) -> Draft:
    count = int(rng.integers(1, 4))
    if hard and rng.random() < 0.5:
        return _gate_at_opening(rng)
    if rng.random() < 0.5:
        width = any_width(rng)
        needed = START_AT + FIRST_GATE + GATES_APART * (count - 1) + RUN_OUT + GOAL_BEFORE_END
        length = uniform(rng, max(12.0, needed), max(20.0, needed))
        gates = draw_gates(rng, START_AT + FIRST_GATE, length - GOAL_BEFORE_END - RUN_OUT, width, count, 0)
        return {"segments": [{"length": length, "width": width, "gates": [*gates]}]}
    before: Draft = {"length": uniform(rng, 6, 10), "width": any_width(rng), "then": any_side(rng)}
    after: Draft = {"length": uniform(rng, 7, 12), "width": any_width(rng)}
    end = before["length"] - after["width"] / 2 - CORNER_ROOM
    before["gates"] = [*draw_gates(rng, START_AT + FIRST_GATE, end, before["width"], min(1, count - 1), 0)]
    begin = before["width"] / 2 + (HARD_CORNER_ROOM if hard else CORNER_ROOM)
    end = begin + 0.5 if hard else after["length"] - GOAL_BEFORE_END - RUN_OUT
    first = len(before["gates"])
    after["gates"] = [*draw_gates(rng, begin, end, after["width"], count - first, first)]
    return {"segments": [before, after]}


def _gate_at_opening(rng: np.random.Generator) -> Draft:
    """Draw a gate where a wide branch leaves a wall on one side only; the car goes straight on."""
    width, opening = any_width(rng), uniform(rng, 2.4, 4)
    before: Draft = {"length": uniform(rng, 7, 10), "width": width, "then": "straight", "sign": False}
    before["branches"] = [{"to": any_side(rng), "length": uniform(rng, 1, 3), "width": opening}]
    middle = before["length"] - opening / 4
    before["gates"] = [*draw_gates(rng, middle - 0.2, middle, width, 1, 0)]
    return {"segments": [before, {"length": uniform(rng, 5, 10), "width": width}]}


def _crossing(rng: np.random.Generator, _: bool) -> Draft:
    count = int(rng.integers(1, 4))
    segments: list[Draft] = [{"length": uniform(rng, 5, 8), "width": any_width(rng)} for _ in range(count + 1)]
    for segment, after in pairwise(segments):
        open_crossing(rng, segment, after)
    return {"segments": segments}


_FURNITURE = ("cupboards", "obstacles", "gate", "nothing")
"""One of these stands in each segment of an office."""


def _office(rng: np.random.Generator, hard: bool) -> Draft:
    target = uniform(rng, 25, 60)
    segments: list[Draft] = []
    while (length := sum(s["length"] for s in segments)) < target - 4.0:
        left = target - length
        length = uniform(rng, 5, 11)
        segments.append({"length": round(left, 3) if left - length < 4.0 else length, "width": any_width(rng)})
    gates = 0
    for i, (frame, segment) in enumerate(zip(join_without_overlap(rng, segments), segments, strict=True)):
        begin = START_AT + RUN_IN if i == 0 else frame.clear_from
        end = frame.clear_to - (GOAL_BEFORE_END if i == len(segments) - 1 else 0.0)
        if i % len(_FURNITURE) == 0:
            order = rng.permutation(len(_FURNITURE))
        what = _FURNITURE[order[i % len(_FURNITURE)]]
        if what != "cupboards" and rng.random() < 0.6:
            segment["doors"] = [*draw_doors(rng, begin, end)]
        gates += _furnish(rng, segment, what, begin + (1.0 if i == 0 else CORNER_ROOM), end - CORNER_ROOM, gates)
    return {"segments": segments}


def _furnish(rng: np.random.Generator, segment: Draft, what: str, begin: float, end: float, gates: int) -> int:
    """Put cupboards, boxes or gate number `gates` into a segment, and give the number of gates in it."""
    if what == "cupboards":
        segment["cupboards"] = [*draw_cupboards(rng, begin, end)]
    elif what == "obstacles":
        segment["obstacles"] = [*draw_obstacles(rng, begin, end, segment["width"], int(rng.integers(1, 3)))]
    elif what == "gate":
        segment["gates"] = [*draw_gates(rng, begin, end, segment["width"], 1, gates)]
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
