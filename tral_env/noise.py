"""Noise that belongs to a row: the same for a row of a batch as for that row alone."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Array, Rows, is_any, pick

LENGTH = 4096
"""A row keeps this many draws of each kind; when they are used up it draws as many anew."""
_CHUNK = 512
"""Normal numbers are drawn so many at a time, when they are needed: an episode that ends early never draws the rest."""


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
        self._drawn = np.zeros(n, np.int64)
        """(n,) normal numbers drawn so far."""
        self._row = np.arange(n)
        self._rngs: list[np.random.Generator | None] = [None] * n

    def reset(self, row: int, rng: np.random.Generator) -> None:
        """Draw new tapes for one row, and keep the generator for those after them."""
        self._rngs[row] = rng
        self._draw(row)

    def _draw(self, row: int) -> None:
        """Begin new tapes; the normal numbers come from the generator after all the uniform ones."""
        self._generator(row).random(out=self._uniform[row])
        self._cursor[row] = self._drawn[row] = 0

    def _draw_normal(self, row: int, end: int) -> None:
        """Draw the normal numbers before `end`, which is in the tape."""
        drawn = int(self._drawn[row])
        if end > drawn:
            end = min(-(-end // _CHUNK) * _CHUNK, self._normal.shape[1])
            self._generator(row).standard_normal(out=self._normal[row, drawn:end])
            self._drawn[row] = end

    def _generator(self, row: int) -> np.random.Generator:
        rng = self._rngs[row]
        assert rng is not None, "a row is reset before it is read"
        return rng

    def _prepare(self, row: int, k: int) -> None:
        """Let a row have the next k numbers; with fewer than k left on its tapes it begins new ones."""
        length = self._normal.shape[1]
        if self._cursor[row] + k > length:
            self._draw_normal(row, length)
            self._draw(row)
        self._draw_normal(row, int(self._cursor[row]) + k)

    def _read(self, tape: Array, rows: Rows, k: int) -> Array:
        """The next k numbers of the rows, whose cursors move on by k."""
        cursor, length = pick(self._cursor, rows), tape.shape[1]
        if is_any(scarce := cursor + k > pick(self._drawn, rows)):
            for row in self._row[rows][scarce].tolist():
                self._prepare(row, k)
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
