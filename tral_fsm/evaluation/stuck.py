"""Cars that make no way."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

STUCK_M = 0.25
"""A car is stuck if it gains less along the route than this in its patience. Source: choice."""


class StuckWatch:
    """Finds cars that make no way."""

    def __init__(self, n: int, patience_s: float) -> None:
        """Watch n cars.

        Args:
            n: number of cars.
            patience_s: time without progress after which a car is stuck, s; inf: no car ever is.
        """
        self._patience_s = patience_s
        self._best, self._since = np.zeros(n), np.zeros(n)

    def reset(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> None:
        """Begin anew in some rows."""
        self._best[rows] = self._since[rows] = 0.0

    def stuck(self, gained_m: NDArray[Any], time_s: NDArray[Any]) -> NDArray[np.bool_]:
        """(n,) cars that gained less than `STUCK_M` along their routes in the patience.

        Args:
            gained_m: (n,) way along the route, m.
            time_s: (n,) time since reset, s.
        """
        ahead = gained_m > self._best + STUCK_M
        self._best = np.where(ahead, gained_m, self._best)
        self._since = np.where(ahead, time_s, self._since)
        stuck: NDArray[np.bool_] = time_s - self._since > self._patience_s
        return stuck
