"""When ultrasonics fire and when their ranges can be read.

A ranger fires, listens for its cadence and then holds the range in a register, which is read just before it fires
again. So a range is one cadence old when it arrives and ages until the next one replaces it. Source: SRF08.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import MAX_AGE_S, NO_ECHO_M

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SONARS = ("left", "front", "right")
"""Order of the ultrasonics along the second axis."""
BORESIGHT = np.array([np.pi / 2, 0.0, -np.pi / 2])
"""Direction in which each looks, rad from the car's x axis."""


class Ranging:
    """Published and pending ranges of n cars with three rangers each."""

    def __init__(self, n: int) -> None:
        """Nothing measured yet."""
        self.range_m = np.full((n, len(SONARS)), NO_ECHO_M)
        """(n, 3) ranges that can be read."""
        self._fired = np.full((n, len(SONARS)), -MAX_AGE_S)
        self._pending_range = self.range_m.copy()
        self._pending_fired = self._fired.copy()

    def reset(self, rows: Index, range_m: Array) -> None:
        """Publish the ranges (k, 3) measured at time 0 for the rows."""
        self.range_m[rows] = self._pending_range[rows] = range_m
        self._fired[rows] = self._pending_fired[rows] = 0.0

    def fire(self, rows: Index, sonars: Index, range_m: Array, time_s: Array) -> None:
        """A ranging begins: what the last one found is published.

        Args:
            rows: (k,) cars.
            sonars: (k,) which of `SONARS`.
            range_m: (k,) what this ranging will find.
            time_s: (k,) when it fired.
        """
        at = rows, sonars
        self.range_m[at], self._fired[at] = self._pending_range[at], self._pending_fired[at]
        self._pending_range[at], self._pending_fired[at] = range_m, time_s

    def age(self, time_s: Array) -> Array:
        """(n, 3) time since the published ranges were measured, s; `time_s` is (n,)."""
        age: Array = np.minimum(time_s[:, None] - self._fired, MAX_AGE_S)
        return age
