"""Ticks at which a car has settled at its wanted clearance: they tell how well it keeps it, not how it got there.

A car may start anywhere in its corridor. The way from there to its clearance says little about how well it keeps the
clearance, but a second of that way outweighs all the rest in a mean square. So a tick counts as settled from the first
arrival within 5 cm on, overshoot included. A car that has not arrived after 4 m counts from there on, or the worst
machine would look best. A state that wants another side or clearance, or none, starts the way anew; doors and corners
do not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import CONTROL_PERIOD_S

Array = NDArray[np.float64]

ARRIVED_M = 0.05
"""Largest error of a car that has arrived. Source: choice; a good machine has a half to a quarter of it."""
MAX_WAY_M = 4.0
"""Way after which a car counts as arrived in any case. Source: measured; on straights the machine `wall` arrives after
3.4 m at most from 0.8 m beside its clearance."""


class Settling:
    """Settled ticks of n cars."""

    def __init__(self, n: int) -> None:
        self._wanted = np.full((n, 2), np.nan)
        self._driven = np.zeros(n)
        self._arrived = np.zeros(n, bool)

    def begin(self, rows: NDArray[np.int64]) -> None:
        """Start the way of the rows anew."""
        self._wanted[rows] = np.nan

    def add(self, rows: NDArray[np.int64], wanted: Array, error: Array, speed: Array) -> NDArray[np.bool_]:
        """Add a tick.

        Args:
            rows: (k,) the cars.
            wanted: (k, 2) wanted side and clearance [m]; NaN: none.
            error: (k,) clearance error, m; NaN where it is not measured.
            speed: (k,) m/s.

        Returns:
            (k,) whether the tick is settled and its error measured.
        """
        same = (wanted == self._wanted[rows]).all(axis=1)
        driven = np.where(same, self._driven[rows], 0.0) + np.abs(speed) * CONTROL_PERIOD_S
        arrived = (same & self._arrived[rows]) | (np.abs(error) <= ARRIVED_M) | (driven >= MAX_WAY_M)
        self._wanted[rows], self._driven[rows], self._arrived[rows] = wanted, driven, arrived
        settled: NDArray[np.bool_] = arrived & np.isfinite(error)
        return settled


def settled_ticks(wanted: Array, error: Array, speed: Array) -> NDArray[np.bool_]:
    """Whether each tick of one drive is settled: (T, 2), (T,), (T,) as in `Settling.add` -> (T,)."""
    one, row = Settling(1), np.zeros(1, np.int64)
    return np.array(
        [one.add(row, wanted[k : k + 1], error[k : k + 1], speed[k : k + 1])[0] for k in range(len(error))], bool
    )
