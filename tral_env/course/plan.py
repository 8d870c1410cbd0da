"""What a course is once its geometry is worked out: boxes, markers, a route. Arrays only; course frame, m and rad.

The course frame begins at the start of the first segment: x along its middle line, y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.geometry import MARKER_SIZE_M

BOX_KINDS = ("wall", "door", "frame", "obstacle", "post")
"""A box is one of these; `Plan.box_kind` holds indices into them."""


def _empty(*shape: int) -> Array:
    return np.zeros(shape)


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """Geometry of a course, ready for physics, perception and task."""

    box_position: Array
    """(B, 3) centres of the boxes."""
    box_yaw: Array
    """(B,) yaw of the boxes."""
    box_size: Array
    """(B, 3) half lengths of the boxes."""
    box_kind: NDArray[np.int64]
    """(B,) index into `BOX_KINDS`."""
    route: Array
    """(R, 2) points of the intended line from the start pose to the goal, at most 0.1 m apart."""
    start: Array
    """(3,) pose of the car's frame: x, y, yaw."""
    gate_pose: Array = field(default_factory=lambda: _empty(0, 3))
    """(G, 3) middle x, y and yaw of the driving direction through it, in the order of the route."""
    gate_width: Array = field(default_factory=lambda: _empty(0))
    """(G,) inner width between the posts."""
    gate_id: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """(G,) gate k wears the markers 2k (left) and 2k + 1 (right)."""
    marker_position: Array = field(default_factory=lambda: _empty(0, 3))
    """(M, 3) centres of the marker faces."""
    marker_yaw: Array = field(default_factory=lambda: _empty(0))
    """(M,) direction of the face's normal, towards the viewer."""
    marker_id: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """(M,) ids in DICT_4X4_50."""
    marker_size: float = MARKER_SIZE_M
    """Edge of the black square."""
    tape: Array = field(default_factory=lambda: _empty(0, 4))
    """(T, 4) floor tape: x0, y0, x1, y1 of its middle line."""
    straights: Array = field(default_factory=lambda: _empty(0, 5))
    """(S, 5) stretches of plain parallel walls, at least 1 m from doors, corners, gates and obstacles: x, y of the
    start on the middle line, yaw, length, width. Clearance errors are measured here."""
    laps: int = 1
    """How often the route is driven."""

    @cached_property
    def route_s(self) -> Array:
        """(R,) arc length at the points of the route."""
        return arc_length(self.route)

    @cached_property
    def gate_s(self) -> Array:
        """(G,) places of the gates on the route, m."""
        return place_on(self.route, self.gate_pose[:, :2])

    @property
    def length(self) -> float:
        """Length of the route, m."""
        return float(self.route_s[-1])


END_M = 3.0
"""An episode that begins anywhere on its route has so much of it ahead, m. Source: choice."""


def begun_anywhere(plan: Plan, rng: np.random.Generator) -> Plan:
    """The course, of one lap, from a place that is drawn."""
    return begun_at(plan, rng.uniform(0.0, max(plan.length - END_M, 0.0)))


def begun_at(plan: Plan, place: float) -> Plan:
    """The course from a place of its route on. The car starts there, along the route; gates behind it do not count.

    Args:
        plan: the whole course, of one lap.
        place: arc length, m, before the end of the route.
    """
    first = int(np.searchsorted(plan.route_s, place, side="right"))
    share = (place - plan.route_s[first - 1]) / (plan.route_s[first] - plan.route_s[first - 1])
    along = plan.route[first] - plan.route[first - 1]
    here = plan.route[first - 1] + share * along
    ahead = plan.gate_s > place
    return replace(
        plan,
        route=np.vstack([here, plan.route[first:]]),
        start=np.array([*here, np.arctan2(along[1], along[0])]),
        gate_pose=plan.gate_pose[ahead],
        gate_width=plan.gate_width[ahead],
        gate_id=plan.gate_id[ahead],
    )


def steps(line: Array) -> tuple[Array, Array, Array]:
    """Steps from each point of a line (R, 2) to the next: x, y and length, (R - 1,) m each."""
    x, y = line[1:, 0] - line[:-1, 0], line[1:, 1] - line[:-1, 1]
    return x, y, np.sqrt(x * x + y * y)


def arc_length(line: Array) -> Array:
    """Distance along a line at its points, (R, 2) -> (R,) m."""
    _, _, length = steps(line)
    place = np.zeros(len(line))
    np.cumsum(length, out=place[1:])
    return place


_SAME_M = 1e-6
"""Distances that differ by less are equal."""


def place_on(route: Array, points: Array) -> Array:
    """Arc length at which a route comes nearest to points.

    A piece from a in the direction u (unit vector), of length l, comes nearest to p at a + t u with
    ``t = clip((p - a) . u, 0, l)``.

    Args:
        route: (R, 2) m.
        points: (P, 2) m.

    Returns:
        (P,) m; the last such place where the route comes by twice, so that what stands at the start of a ring is passed
        at its end.
    """
    if not len(points):
        return np.zeros(0)
    x, y = route[:-1, 0], route[:-1, 1]
    along_x, along_y = route[1:, 0] - x, route[1:, 1] - y
    length = np.hypot(along_x, along_y)
    unit_x, unit_y = along_x / length, along_y / length
    offset_x, offset_y = points[:, :1] - x, points[:, 1:] - y
    t = np.minimum(np.maximum(offset_x * unit_x + offset_y * unit_y, 0.0), length)
    distance = np.hypot(offset_x - unit_x * t, offset_y - unit_y * t)
    near = distance <= distance.min(axis=1, keepdims=True) + _SAME_M
    place = np.concatenate([[0.0], length.cumsum()[:-1]]) + t
    nearest: Array = np.where(near, place, -np.inf).max(axis=1)
    return nearest
