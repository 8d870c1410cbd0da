"""Which boxes, seen from above, stand in each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.course.plan import Array

TOUCH = 1e-6
"""Boxes that share less than this are side by side, m."""


def overlapping(position: Array, yaw: Array, half: Array, first: int = 0) -> NDArray[np.int64]:
    """Pairs of boxes that overlap.

    Two convex shapes are apart if and only if the shadows they throw on the normal of one of their edges are.

    Args:
        position: (B, 2) centres, m.
        yaw: (B,) rad.
        half: (B, 2) half lengths, m.
        first: boxes before this one are not looked at among themselves.

    Returns:
        (K, 2) indices i > j, i >= first.
    """
    # Depth of an overlap is least along the normal of an edge: upright rectangles around the boxes overlap by as much.
    c, s = np.abs(np.cos(yaw)), np.abs(np.sin(yaw))
    x, y = half[:, 0] * c + half[:, 1] * s, half[:, 0] * s + half[:, 1] * c
    near = np.abs(position[first:, None, 0] - position[:, 0]) < x[first:, None] + x - TOUCH / 2
    near &= np.abs(position[first:, None, 1] - position[:, 1]) < y[first:, None] + y - TOUCH / 2
    i, j = np.nonzero(near)
    i += first
    later = i > j
    i, j = i[later], j[later]
    if not len(i):
        return np.zeros((0, 2), np.int64)
    line = position[i] - position[j]
    apart = np.zeros(len(i), bool)
    for axis in (yaw[i], yaw[i] + np.pi / 2, yaw[j], yaw[j] + np.pi / 2):
        distance = np.abs(line[:, 0] * np.cos(axis) + line[:, 1] * np.sin(axis))
        apart |= distance > _shadow(half[i], yaw[i] - axis) + _shadow(half[j], yaw[j] - axis) - TOUCH
    return np.column_stack([i, j])[~apart]


def _shadow(half: Array, angle: Array) -> Array:
    """Half length of boxes' shadows on lines at an angle to them."""
    shadow: Array = half[:, 0] * np.abs(np.cos(angle)) + half[:, 1] * np.abs(np.sin(angle))
    return shadow
