"""Noise that belongs to a row: the same for a row of a batch as for that row alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LENGTH = 4096
"""A row keeps this many draws of each kind; after the last one it reads the first one again."""


class NoiseTape:
    """Uniform and normal numbers, drawn per row at reset and read in order.

    A generator per row makes row i independent of all other rows, and a tape makes that cheap: a read is one gather.
    """

    def __init__(self, n: int, length: int = LENGTH) -> None:
        """Empty tapes for n rows."""
        self._uniform = np.zeros((n, length))
        self._normal = np.zeros((n, length))
        self._cursor = np.zeros(n, np.int64)

    def reset(self, row: int, rng: np.random.Generator) -> None:
        """Draw new tapes for one row."""
        rng.random(out=self._uniform[row])
        rng.standard_normal(out=self._normal[row])
        self._cursor[row] = 0

    def _advance(self, rows: NDArray[np.int64], k: int) -> NDArray[np.int64]:
        """Move the cursors of the rows on by k, and give the columns that they passed, (len(rows), k)."""
        columns: NDArray[np.int64] = (self._cursor[rows, None] + np.arange(k)) % self._uniform.shape[1]
        self._cursor[rows] += k
        return columns

    def uniform(self, rows: NDArray[np.int64], k: int) -> NDArray[np.float64]:
        """Next k numbers in [0, 1) of each of the rows, shape (len(rows), k)."""
        return self._uniform[rows[:, None], self._advance(rows, k)]

    def normal(self, rows: NDArray[np.int64], k: int) -> NDArray[np.float64]:
        """Next k standard normal numbers of each of the rows, shape (len(rows), k)."""
        return self._normal[rows[:, None], self._advance(rows, k)]
