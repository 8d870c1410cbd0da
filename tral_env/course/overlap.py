"""Turned rectangles, boxes seen from above: how much room they take, and which of them stand in each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.se2 import Number

TOUCH = 1e-6
"""Boxes that share less than this are side by side, m."""


def level_half(half_x: Number, half_y: Number, cos: Number, sin: Number) -> tuple[Number, Number]:
    """Half the extent along x and y of rectangles turned by an angle: ``|c| a + |s| b`` and ``|s| a + |c| b``.

    Args:
        half_x: a, half length along the rectangle's own x axis, m.
        half_y: b, half length along its own y axis, m.
        cos: c, cosine of the angle.
        sin: s, sine of the angle.
    """
    return abs(cos) * half_x + abs(sin) * half_y, abs(sin) * half_x + abs(cos) * half_y


def overlapping(position: Array, yaw: Array, half: Array, first: int = 0) -> NDArray[np.int64]:
    """Find the pairs of boxes that overlap, by the separating axis theorem.

    Two convex shapes are apart if and only if the shadows that they throw on the normal of one of their edges are
    apart.

    Args:
        position: (B, 2) centres, m.
        yaw: (B,) rad.
        half: (B, 2) half lengths, m.
        first: boxes before this one are not looked at among themselves.

    Returns:
        (K, 2) indices i > j, i >= first.
    """
    if first == len(yaw):
        return np.zeros((0, 2), np.int64)
    # The level rectangles around two boxes overlap at least as deep as the boxes do: they pick the pairs worth a test.
    x, y = level_half(half[:, 0], half[:, 1], np.cos(yaw), np.sin(yaw))
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
    return level_half(half[:, 0], half[:, 1], np.cos(angle), np.sin(angle))[0]
