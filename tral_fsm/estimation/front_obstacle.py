"""What the front ultrasonic hears, kept while the car moves: how far it is, since when, and how far aside."""

from __future__ import annotations

import math
from typing import NamedTuple

from tral_fsm.estimation.sonar import MAX_ECHO_RANGE_M

_JUMP_M = 0.08
"""What is heard ahead comes nearer by what was driven, give or take this, m."""
_MAX_MISSES = 3
"""So many readings in a row may be wrong before something else is ahead."""
_MIN_KNOWN = 3
"""What was heard in fewer readings is not remembered."""
_SAME_M = 0.25
"""What is heard anew is what was lost if it is where that was, give or take this, m."""
_MEMORY_M = 1.0
"""What was lost is forgotten after this way, m: dropouts end sooner, and what comes later may be a box."""
_MIN_FIT = 6
"""Readings from which the lateral offset is told."""
_MIN_SPREAD_M = 0.08
"""Standard deviation of their places from which the lateral offset is told, m."""
_NO_SUMS = (0.0, 0.0, 0.0, 0.0, 0.0)

Sums = tuple[float, float, float, float, float]


class FrontObstacle(NamedTuple):
    """What is ahead, as far as it has been heard: from how far on tells a wall from a box.

    A wall across the corridor answers from 5 m on. A box that is turned, or beside the car's way, is heard by its edges
    alone, from 2 m on.
    """

    range: float = math.inf
    """Last reading that the one before predicted, m; inf: none."""
    first_range: float = math.inf
    """Range at which it was first heard, m. It is kept if the echoes fail and it is soon heard again where it was."""
    last_range: float = math.inf
    """The last reading, whatever it was of, m."""
    streak: int = 0
    """Readings in a row, the last one included, of which each was predicted by the one before."""
    sums: Sums = _NO_SUMS
    """Sums of the line z = r^2 - s^2 over s: n, s, s^2, z, z s."""

    @property
    def nearest(self) -> float:
        """What is ahead, or what has only just come up nearer than that, m; inf: nothing."""
        near = min(self.range, self.last_range)
        return near if near < MAX_ECHO_RANGE_M else math.inf

    @property
    def support(self) -> int:
        """Readings that agree on it so far."""
        return int(self.sums[0])

    @property
    def lateral_offset(self) -> float:
        """How far beside the car's way it is, m, to either side; NaN: not known yet.

        A car that passes a point at (X, L) hears r^2 = (X - s)^2 + L^2, so r^2 - s^2 is a line over s, with slope -2 X
        and X^2 + L^2 at its beginning. What is ahead comes nearer by what was driven; what is aside by less.
        """
        n, s, s2, z, zs = self.sums
        spread = n * s2 - s * s
        if n < _MIN_FIT or spread < (_MIN_SPREAD_M * n) ** 2:
            return math.nan
        slope = (n * zs - s * z) / spread
        square = (z - slope * s) / n - slope * slope / 4.0
        return math.sqrt(square) if square > 0.0 else 0.0


class FrontObstacleTracker:
    """Makes a `FrontObstacle` of front ranges, for one car."""

    __slots__ = ("_begin", "_known", "_last_way", "_missed", "_range", "_way", "obstacle")

    def __init__(self) -> None:
        self.obstacle = FrontObstacle()
        self._last_way = 0.0
        """Way at the last reading, m."""
        self._range, self._way = math.inf, 0.0
        """Last reading that was predicted, and the way at it, m."""
        self._missed = 0
        self._begin = 0.0
        self._known = (math.inf, 0.0, 0.0)

    def update(self, reading: float, way: float) -> None:
        """Take a new reading.

        Args:
            reading: m.
            way: the way so far, less where the car reversed, m.
        """
        before = self.obstacle
        predicted = before.last_range - (way - self._last_way)
        streak = before.streak + 1 if -_JUMP_M <= reading - predicted <= _JUMP_M else 1
        self._last_way = way
        predicted = self._range - (way - self._way)
        if reading < MAX_ECHO_RANGE_M and -_JUMP_M <= reading - predicted <= _JUMP_M:
            self._missed = 0
            self._range, self._way = reading, way
            sums = self._added(before.sums, reading, way)
            if sums[0] >= _MIN_KNOWN:
                self._known = reading, way, before.first_range
            self.obstacle = FrontObstacle(reading, before.first_range, reading, streak, sums)
        elif self._missed < _MAX_MISSES and predicted < math.inf:
            self._missed += 1
            self.obstacle = FrontObstacle(before.range, before.first_range, reading, streak, before.sums)
        else:
            self._begin_anew(reading, way, streak)

    def _begin_anew(self, reading: float, way: float, streak: int) -> None:
        """Something else is ahead, or nothing."""
        self._missed = 0
        self._range = first_range = math.inf
        self._begin = self._way = way
        sums = _NO_SUMS
        if reading < MAX_ECHO_RANGE_M:
            self._range = reading
            first_range = max(reading, self._remembered(reading, way))
            sums = self._added(sums, reading, way)
        self.obstacle = FrontObstacle(math.inf, first_range, reading, streak, sums)

    def _remembered(self, reading: float, way: float) -> float:
        """From where on what is heard now had been heard before it was lost, m; 0: it is something else."""
        known, then, first_range = self._known
        same = abs(way - then) <= _MEMORY_M and abs(reading - known + way - then) <= _SAME_M
        return first_range if same else 0.0

    def _added(self, sums: Sums, reading: float, way: float) -> Sums:
        """The sums with one reading more."""
        s = way - self._begin
        z = reading * reading - s * s
        n, ss, s2, sz, zs = sums
        return n + 1.0, ss + s, s2 + s * s, sz + z, zs + z * s
