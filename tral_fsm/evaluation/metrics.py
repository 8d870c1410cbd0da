"""Figures of how well a car drove, from the truths in an environment's info."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def clearance_error(left: Array, right: Array, wanted: Array) -> Array:
    """Clearance to the followed wall minus the one that is wanted.

    Args:
        left: (n,) true distance to the left wall, m or NaN.
        right: (n,) true distance to the right wall, m or NaN.
        wanted: (n, 2) side (+1 left, -1 right, NaN none) and clearance, m.

    Returns:
        (n,) m; NaN where there is no wall or no wish.
    """
    side, metres = wanted[:, 0], wanted[:, 1]
    wall = np.where(side > 0, left, np.where(side < 0, right, np.nan))
    error: Array = wall - metres
    return error
