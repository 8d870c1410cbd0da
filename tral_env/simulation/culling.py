"""Which boxes of its course a car has around it: only those that it can range or touch stand in its physics.

Every geom costs time in every step, wherever it stands. So a model holds no more boxes than fit around one car, and as
the car moves on the nearest ones take the places of those left behind. Nothing within reach is missing as long as a
course has no more boxes within reach of a place than the model holds, which `max_boxes_in_reach` tells. On a denser
course the farthest are left out.
"""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Array, Index, columns, everyone, is_any, pick
from tral_env.config import UltrasonicConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import Placement, Pool, place
from tral_env.se2 import rotate_back

LOCAL_BOXES = 48
"""Number of boxes around a car. The families of courses have at most 46 within 5.5 m of a place on their routes; a
course of your own gets as many as its densest place needs, see `max_boxes_in_reach`."""
REACH_M = UltrasonicConfig().max_range + 0.35
"""A sonar hears this far from the rear axle, m: its range, and how far ahead of the axle it sits."""
_MIN_FREE_M = 0.25
"""Where more boxes are within reach than the model holds, the farthest are left out, and the car looks again after this
distance, m."""
_ROUTE_MARGIN_M = 1.0
"""Up to this distance from its route, m, a car has no more boxes within reach than `max_boxes_in_reach` counts."""
_NOBODY = np.zeros(0, np.int64)
_CHUNK = 64
"""Number of places on a route that are looked at together."""


class LocalGeoms:
    """The boxes of n courses, and those of them that stand around the n cars."""

    def __init__(self, n: int, boxes: int, near: int = 0) -> None:
        """No boxes yet.

        Args:
            n: number of cars.
            boxes: how many a course may have at the most.
            near: how many of them may be near a car, if that may be more than in the families of courses.
        """
        self.size = min(boxes, max(LOCAL_BOXES, near))
        """Number of boxes around a car, W."""
        self._pos, self._quat, self._half = np.zeros((n, boxes, 3)), np.zeros((n, boxes, 4)), np.zeros((n, boxes, 3))
        self._centre = np.zeros((n, 2))
        self._free = np.full(n, np.inf)
        self._everyone = everyone(n)

    def place(self, row: int, placed: Placement) -> None:
        """Keep the boxes of a car's course, which are the first of a placement."""
        boxes = self._pos.shape[1]
        self._pos[row], self._quat[row] = placed.geom_pos[:boxes], placed.geom_quat[:boxes]
        self._half[row] = placed.geom_size[:boxes]

    def due(self, position: Array) -> Index:
        """Rows whose cars may soon have something within reach that their models leave out.

        Args:
            position: (n, 2) of the cars, m.
        """
        x, y = columns(position, self._everyone)
        x0, y0 = columns(self._centre, self._everyone)
        dx, dy, free = x - x0, y - y0, pick(self._free, self._everyone)
        far = dx * dx + dy * dy > free * free
        return np.flatnonzero(far) if is_any(far) else _NOBODY

    def nearest(self, rows: Index, position: Array) -> tuple[Array, Array, Array]:
        """The boxes nearest to cars, in the order of their courses.

        Args:
            rows: (k,) which cars.
            position: (k, 2) where they are, m.

        Returns:
            Positions (k, W, 3), quaternions (k, W, 4) and half sizes (k, W, 3).
        """
        self._centre[rows] = position
        everything = self._pos[rows], self._quat[rows], self._half[rows]
        if self.size == self._pos.shape[1]:
            return everything
        distance = _distance(self._pos[rows], self._quat[rows], self._half[rows], position)
        order = np.argsort(distance, axis=1, kind="stable")
        left_out = distance[np.arange(len(rows)), order[:, self.size]]
        self._free[rows] = np.maximum(left_out - REACH_M, _MIN_FREE_M)
        near = np.sort(order[:, : self.size], axis=1)[..., None]
        pos, quat, half = (np.take_along_axis(values, near, axis=1) for values in everything)
        return pos, quat, half


def max_boxes_in_reach(plan: Plan) -> int:
    """The most boxes of a course that are within reach at once, anywhere on its route or a metre beside it."""
    boxes = len(plan.box_kind)
    if boxes <= LOCAL_BOXES:
        return boxes
    placed = place(plan, Pool(boxes, len(plan.marker_id), len(plan.tape)))
    pos, quat, half = (getattr(placed, name)[None, :boxes] for name in ("geom_pos", "geom_quat", "geom_size"))
    parts = np.array_split(plan.route, -(-len(plan.route) // _CHUNK))
    return max(int((_distance(pos, quat, half, part) < REACH_M + _ROUTE_MARGIN_M).sum(axis=1).max()) for part in parts)


def _distance(pos: Array, quat: Array, half: Array, position: Array) -> Array:
    """(k, B) distance from cars to the floor plans of their boxes, m; infinite for boxes parked below the floor."""
    w, z = quat[..., 0], quat[..., 3]
    cos, sin = w * w - z * z, 2 * w * z
    dx, dy = position[:, None, 0] - pos[..., 0], position[:, None, 1] - pos[..., 1]
    x, y = rotate_back(cos, sin, dx, dy)
    along, across = np.maximum(np.abs(x) - half[..., 0], 0.0), np.maximum(np.abs(y) - half[..., 1], 0.0)
    return np.where(pos[..., 2] < 0.0, np.inf, np.sqrt(along * along + across * across))
