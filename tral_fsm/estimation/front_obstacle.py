"""What the front ultrasonic hears, kept while the car comes nearer: how far it is, since when, and how far aside."""

from __future__ import annotations

import math

from tral_fsm.estimation.sonar import HEARD_M

_JUMP = 0.08
"""What is heard ahead comes nearer by what was driven, give or take this, m."""
_MISSES = 3
"""So many readings in a row may be wrong before something else is ahead."""
_SAME = 0.25
"""What is heard anew is what was lost if it is where that was, give or take this, m,"""
_LOST = 1.0
"""and if the car has gone no farther than this since, m: dropouts end sooner, and what comes later may be a box."""


class Ahead:
    """What the front ultrasonic hears: from how far on it has been heard tells a wall from a box.

    A wall across the corridor answers from 5 m on. A box that is turned, or beside the car's way, is heard by its edges
    alone, from 2 m on. What echoes have lost is the same still if it is soon heard again where it was.
    """

    __slots__ = (
        "_begin",
        "_driven",
        "_known",
        "_last_driven",
        "_missed",
        "_range",
        "_sums",
        "heard_from",
        "last",
        "range",
        "run",
    )

    def __init__(self) -> None:
        self.range = math.inf
        """Last reading that was foretold by the one before, m; inf: none."""
        self.heard_from = math.inf
        """Range at which it was first heard, m; kept if it is lost and soon heard again where it was."""
        self.last = math.inf
        """The last reading, whatever it was of, m."""
        self.run = 0
        """Readings in a row, the last one included, of which each was foretold by the one before."""
        self._last_driven = 0.0
        self._range = math.inf
        self._driven = 0.0
        self._missed = 0
        self._begin = 0.0
        self._sums = (0.0, 0.0, 0.0, 0.0, 0.0)
        self._known = (math.inf, 0.0, 0.0)

    def take(self, reading: float, driven: float, path: float) -> None:
        """Take a reading [m].

        Args:
            reading: m.
            driven: the way so far, m.
            path: the way so far, less where the car reversed, m.
        """
        foretold = self.last - (driven - self._last_driven)
        self.run = self.run + 1 if -_JUMP <= reading - foretold <= _JUMP else 1
        self.last, self._last_driven = reading, driven
        foretold = self._range - (driven - self._driven)
        if reading < HEARD_M and -_JUMP <= reading - foretold <= _JUMP:
            self._missed = 0
            self._range, self._driven = reading, driven
            self.range = reading
            self._sum(reading, driven)
            if self.agreed >= _MISSES:
                self._known = reading, path, self.heard_from
        elif self._missed < _MISSES and foretold < math.inf:
            self._missed += 1
        else:
            self._missed = 0
            self._range = self.heard_from = self.range = math.inf
            self._begin = self._driven = driven
            self._sums = (0.0, 0.0, 0.0, 0.0, 0.0)
            if reading < HEARD_M:
                self._range = reading
                self.heard_from = max(reading, self._remembered(reading, path))
                self._sum(reading, driven)

    def _remembered(self, reading: float, path: float) -> float:
        """From where on what is heard now had been heard before it was lost, m; 0: it is something else."""
        known, then, heard_from = self._known
        same = abs(path - then) <= _LOST and abs(reading - known + path - then) <= _SAME
        return heard_from if same else 0.0

    def _sum(self, reading: float, driven: float) -> None:
        """Add to the sums of the line z = r^2 - s^2 over s."""
        s = driven - self._begin
        z = reading * reading - s * s
        n, ss, s2, sz, zs = self._sums
        self._sums = n + 1.0, ss + s, s2 + s * s, sz + z, zs + z * s

    @property
    def near(self) -> float:
        """What is ahead, or what has only just come up nearer than that, m; inf: nothing."""
        near = min(self.range, self.last)
        return near if near < HEARD_M else math.inf

    @property
    def agreed(self) -> int:
        """Readings that agree on it so far."""
        return int(self._sums[0])

    @property
    def aside(self) -> float:
        """How far beside the car's way it is, m, to either side; NaN: not known yet.

        Passing a point at (X, L), r^2 = (X - s)^2 + L^2, so r^2 - s^2 is a line over s, with slope -2 X and
        X^2 + L^2 at its beginning. What is ahead comes nearer by what was driven; what is aside by less.
        """
        n, s, s2, z, zs = self._sums
        spread = n * s2 - s * s
        if n < 6.0 or spread < (0.08 * n) ** 2:
            return math.nan
        slope = (n * zs - s * z) / spread
        square = (z - slope * s) / n - slope * slope / 4.0
        return math.sqrt(square) if square > 0.0 else 0.0
