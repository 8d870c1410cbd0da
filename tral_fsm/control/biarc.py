"""Arcs: the way to a pose on two of them, and where a car is beside one.

Plain floats. Poses are x, y [m], heading [rad], seen from where the arc begins: x forward, y left; curvature + = left.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tral_env.se2 import Pose, clip, relative, to_inner

_MAX_TURN = 0.75 * math.pi
"""Neither arc turns by more: a car that needs more drives past and comes again."""
_TOLERANCE_M = 1e-6
"""Two arcs that miss their end by more are none, m."""
_MAX_ANGLE = math.radians(15.0)
"""A pose that is passed within this angle is reached."""


class Biarc(NamedTuple):
    """An S of two arcs of equal radius."""

    curvature: float
    """Of the first, 1/m; the second has its negative."""
    first: float
    """Length of the first, m."""
    second: float
    """Length of the second, m."""


class ArcPoint(NamedTuple):
    """Where a point is beside an arc."""

    along: float
    """Distance along the arc, m."""
    offset: float
    """To its left, m."""
    direction: float
    """Of the arc there, rad."""


def pose_on_arc(frame: Pose, distance: float, curvature: float = 0.0) -> Pose:
    """The pose after a distance [m] on an arc that begins at a pose."""
    turn = curvature * distance
    half = turn / 2.0
    chord = distance * (math.sin(half) / half if half else 1.0)
    x, y, heading = frame
    return x + chord * math.cos(heading + half), y + chord * math.sin(heading + half), heading + turn


def arc_coordinates(x: float, y: float, curvature: float) -> ArcPoint:
    """Where a point is beside an arc."""
    if abs(curvature) < 1e-9:
        return ArcPoint(x, y, 0.0)
    turn = math.atan2(curvature * x, 1.0 - curvature * y)
    offset = (1.0 - math.hypot(curvature * x, 1.0 - curvature * y)) / curvature
    return ArcPoint(turn / curvature, offset, turn)


def biarc(x: float, y: float, heading: float) -> Biarc | None:
    """The shortest S of two arcs of equal radius from here to a pose; None if one would turn by more than 135 degrees.

    The circles touch: with d the way to the pose, n0 and n1 the left normals of both ends and k the curvature,
    |d - (n0 + n1) / k| = 2 / |k|, so d^2 k^2 - 2 d (n0 + n1) k - 2 (1 - cos(heading)) = 0.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    square = x * x + y * y
    if square < 1e-12:
        return None
    b = y * (1.0 + cos) - x * sin
    root = math.sqrt(b * b + 2.0 * (1.0 - cos) * square)
    best = None
    for curvature in ((b + root) / square, (b - root) / square):
        found = _through(curvature, (x, y, heading), sin, cos)
        if found is not None and (best is None or found.first + found.second < best.first + best.second):
            best = found
    return best


def _through(curvature: float, end: Pose, sin: float, cos: float) -> Biarc | None:
    """The two arcs of a curvature, if they end where they should. They touch in the middle between their centres."""
    if abs(curvature) < 1e-9:
        middle = (end[0] / 2.0, end[1] / 2.0)
    else:
        middle = ((end[0] + sin / curvature) / 2.0, (end[1] + (1.0 - cos) / curvature) / 2.0)
    first = arc_coordinates(*middle, curvature).along
    turning = pose_on_arc((0.0, 0.0, 0.0), first, curvature)
    second = arc_coordinates(*relative(turning, end)[:2], -curvature).along
    if min(first, second) < -_TOLERANCE_M or max(first, second) * abs(curvature) > _MAX_TURN:
        return None
    x, y, _ = pose_on_arc(turning, second, -curvature)
    if math.hypot(x - end[0], y - end[1]) > _TOLERANCE_M:
        return None
    return Biarc(curvature, max(first, 0.0), max(second, 0.0))


def out_of_reach(pose: Pose, radius: float, aside: float) -> str:
    """Why a car cannot come to a pose; empty if it can.

    It can if the way straight on passes within `aside` and 15 degrees of it, or if two arcs lead to within `aside`.

    Args:
        pose: seen from the car.
        radius: smallest that the car can drive, m.
        aside: how far beside the pose is near enough, m.
    """
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    passed, offset = to_inner(pose, 0.0, 0.0)
    ahead = -passed
    if ahead < -aside:
        return f"the target is {-ahead:.2f} m behind"
    if abs(heading) <= _MAX_ANGLE and abs(offset - ahead * math.tan(heading)) <= aside:
        return ""
    curvature = math.inf
    for near in (clip(offset, aside), 0.0, aside, -aside):
        arcs = biarc(x - sin * near, y + cos * near, heading)
        if arcs is not None:
            curvature = min(curvature, abs(arcs.curvature))
            if curvature * radius <= 1.0:
                return ""
    if curvature == math.inf:
        return f"no way leads to {x:.2f}, {y:+.2f} m, {math.degrees(heading):+.0f} deg"
    return f"an arc of {1.0 / curvature:.2f} m is needed, {radius:.2f} m the least"
