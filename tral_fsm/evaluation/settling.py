"""When a car has settled at the clearance that it is after, so that the way there can be told from the keeping of it.

A car may begin anywhere in its corridor. Driving to the wall from there says little about how well a clearance is kept,
but a second of it outweighs all the rest in a mean square. So the error counts as settled from the first arrival within
5 cm, overshoot and all; a car that has not arrived after 4 m counts from there on, or the worst machine would look
best. Where a state wants another clearance or side, or none, it begins anew; doors and corners within a state do not
begin it anew, they must be mastered.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import CONTROL_PERIOD_S

Array = NDArray[np.float64]

ARRIVED_M = 0.05
"""Error of a car that has arrived. Source: choice; two to four times the error of a machine that keeps it well."""
MAX_WAY_M = 4.0
"""A car that has not arrived on this way is taken to be there. Source: measured; the machine `wall` arrives on
straights after 3.4 m at most, from 0.8 m beside its clearance."""


class Settling:
    """Which ticks count, for n cars."""

    def __init__(self, n: int) -> None:
        self._wanted = np.full((n, 2), np.nan)
        self._driven = np.zeros(n)
        self._arrived = np.zeros(n, bool)

    def begin(self, rows: NDArray[np.int64]) -> None:
        """Cars that are put at a start."""
        self._wanted[rows] = np.nan

    def add(self, rows: NDArray[np.int64], wanted: Array, error: Array, speed: Array) -> NDArray[np.bool_]:
        """The next tick of some cars.

        Args:
            rows: (k,) which.
            wanted: (k, 2) side and clearance [m] that they want; NaN: none.
            error: (k,) clearance error, m; NaN where there is none.
            speed: (k,) m/s.

        Returns:
            (k,) whether the tick's error is there and counts as settled.
        """
        same = (wanted == self._wanted[rows]).all(axis=1)
        driven = np.where(same, self._driven[rows], 0.0) + np.abs(speed) * CONTROL_PERIOD_S
        arrived = (same & self._arrived[rows]) | (np.abs(error) <= ARRIVED_M) | (driven >= MAX_WAY_M)
        self._wanted[rows], self._driven[rows], self._arrived[rows] = wanted, driven, arrived
        settled: NDArray[np.bool_] = arrived & np.isfinite(error)
        return settled


def settled_ticks(wanted: Array, error: Array, speed: Array) -> NDArray[np.bool_]:
    """Which ticks of one drive count: (T, 2), (T,), (T,) as in `Settling.add` -> (T,)."""
    one, row = Settling(1), np.zeros(1, np.int64)
    return np.array(
        [one.add(row, wanted[k : k + 1], error[k : k + 1], speed[k : k + 1])[0] for k in range(len(error))], bool
    )
