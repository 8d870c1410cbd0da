"""When the machine takes a car over from the network that it teaches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Flags


class Guard:
    """Says which cars the machine takes over because their network errs for too long.

    So these cars stay where the machine's answers belong together, and come to the end of their courses from the first
    minutes on. The other cars show where the network leads. Source: Zhang and Cho, Query-Efficient Imitation Learning
    for End-to-End Autonomous Driving, 2017 (SafeDAgger).
    """

    _SHARE = 0.1
    """The running mean of the errors takes this share of each new one: it is that of about 10 decisions."""

    def __init__(self, n: int, guarded: float, above: float, decisions: int) -> None:
        """Guard some of n cars.

        Args:
            n: number of cars.
            guarded: share of them that is guarded.
            above: mean error of the steering above which the machine takes over.
            decisions: for so many the machine drives then.
        """
        self._above, self._decisions = above, decisions
        self._guarded = np.arange(n) < round(guarded * n)
        self._error = np.zeros(n)
        self._left = np.zeros(n, np.int64)
        """(n,) decisions for which the machine drives on."""

    @property
    def helps(self) -> Flags:
        """(n,) the machine drives the car."""
        helped: Flags = self._left > 0
        return helped

    def watch(self, rows: Flags, errors: NDArray[np.floating]) -> None:
        """Take over the errors (k,) of the network's steering in the rows (n,) that decide."""
        self._left[rows] = np.maximum(self._left[rows] - 1, 0)
        self._error[rows] += self._SHARE * (errors - self._error[rows])
        begins = rows & self._guarded & (self._left == 0) & (self._error > self._above)
        self._left[begins] = self._decisions
        self._error[begins] = 0.0

    def reset(self, rows: Flags) -> None:
        """New episodes begin."""
        self._error[rows] = 0.0
        self._left[rows] = 0
