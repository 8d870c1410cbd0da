"""Noise that belongs to a row: the same for a row of a batch as for that row alone."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Array, Rows, is_any, pick

LENGTH = 4096
"""A row keeps this many draws of each kind; when they are used up it draws as many anew."""


class NoiseTape:
    """Uniform and normal numbers, drawn per row in advance and read in order.

    A generator per row makes row i independent of all other rows, and a tape makes that cheap: a read is one gather.
    Both kinds have one cursor: a read of one passes over as many numbers of the other. No number is read twice: a tape
    that read its first numbers again would give a row the same few outliers again and again, at a rate of its own.
    """

    def __init__(self, n: int, length: int = LENGTH) -> None:
        """Empty tapes for n rows."""
        self._uniform = np.zeros((n, length))
        self._normal = np.zeros((n, length))
        self._cursor = np.zeros(n, np.int64)
        self._row = np.arange(n)
        self._rngs: list[np.random.Generator | None] = [None] * n

    def reset(self, row: int, rng: np.random.Generator) -> None:
        """Draw new tapes for one row, and keep the generator for those after them."""
        self._rngs[row] = rng
        self._draw(row)

    def _draw(self, row: int) -> None:
        rng = self._rngs[row]
        assert rng is not None, "a row is reset before it is read"
        rng.random(out=self._uniform[row])
        rng.standard_normal(out=self._normal[row])
        self._cursor[row] = 0

    def _read(self, tape: Array, rows: Rows, k: int) -> Array:
        """The next k numbers of the rows, whose cursors move on by k; a row with fewer than k left draws new ones."""
        cursor, length = pick(self._cursor, rows), tape.shape[1]
        if is_any(cursor + k > length):
            for row in self._row[rows][cursor + k > length].tolist():
                self._draw(row)
            cursor = pick(self._cursor, rows)
        if type(rows) is int:
            numbers = tape[:, cursor : cursor + k]
        else:
            # Taking from a flat array costs half of indexing by row and column.
            first = self._row[rows] * length + cursor
            numbers = tape.reshape(-1).take(first[:, None] + np.arange(k))
        self._cursor[rows] = cursor + k
        return numbers

    def uniform(self, rows: Rows, k: int) -> Array:
        """Next k numbers in [0, 1) of each of the rows, shape (len(rows), k); k is at most the tape's length."""
        return self._read(self._uniform, rows, k)

    def normal(self, rows: Rows, k: int) -> Array:
        """Next k standard normal numbers of each of the rows, shape (len(rows), k); k is at most the tape's length."""
        return self._read(self._normal, rows, k)
