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
    reach = np.hypot(half[:, 0], half[:, 1])
    offset = position[first:, None] - position[None]
    near = offset[..., 0] ** 2 + offset[..., 1] ** 2 < (reach[first:, None] + reach[None]) ** 2
    i, j = np.nonzero(near & (np.arange(first, len(yaw))[:, None] > np.arange(len(yaw))[None]))
    i += first
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
