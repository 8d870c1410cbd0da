"""Hall sensor on the rear left wheel: travel of the wheel -> ticks -> distance and speed, without direction. Batched.

Eight magnets pass the sensor in a turn, one each 0.02513 m of travel (ucboard). Each passage interrupts the
microcontroller, which counts it and stamps its time; so the time between two ticks is known far better than to a
control period. Ticks get lost, and counted twice (report: "very unreliable").
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import (
    Array,
    Index,
    Values,
    as_rows,
    columns,
    everyone,
    floor,
    is_any,
    largest,
    maximum,
    minimum,
    pick,
    rint,
    where,
)
from tral_env.config import HallConfig

UPDATE_DRAWS = 2
"""`Hall.update` takes so many uniform numbers for one row: missed, doubled."""

_GOLDEN = 0.6180339887498949
"""The golden ratio: its multiples, taken modulo 1, spread evenly."""


class EdgeSpeed:
    """Distance and speed of n wheels from the time stamps of their edges: one model for the simulated and the real car.

    Every edge counts for the distance. With d the travel of the wheel from edge to edge, the speed at time t is
    ``v = d / max(median of the last three spacings, t - time of the last edge)``:
    the median forgets one missed edge, and the second term lets the speed fall when the car brakes. The speed is 0 once
    the last edge is older than `timeout_s`. An edge that comes sooner than `max_speed` allows is a bounce, and the
    speed leaves it out.
    """

    def __init__(self, n: int, config: HallConfig) -> None:
        """Put n wheels at rest, distance 0."""
        self._config, self._everyone = config, everyone(n)
        self._ticks = np.zeros(n, np.int64)
        self._stamp = np.zeros(n)
        self._spacing = np.zeros((3, n))
        self._median = np.zeros(n)
        self.reset(np.arange(n))

    def reset(self, rows: Index) -> None:
        """Put the wheels of the rows (k,) at rest, distance 0."""
        self._ticks[rows] = 0
        self._stamp[rows] = -np.inf
        self._spacing[:, rows] = self._median[rows] = np.inf

    def edge(self, counted: NDArray[np.bool_], when: Array | float) -> None:
        """Count an edge of some wheels.

        Args:
            counted: (n,) which wheels have an edge.
            when: (n,) or scalar, its time, s; rounded to the resolution of the stamps, `stamp_s`.
        """
        rows = self._everyone
        counted, when = pick(counted, rows), pick(when, rows)
        if not is_any(counted):
            return
        stamp = rint(when / self._config.stamp_s) * self._config.stamp_s
        before, oldest, middle, last = (pick(values, rows) for values in (self._stamp, *self._spacing))
        spacing = stamp - before
        timed = counted & (spacing >= self._config.metres_per_tick / self._config.max_speed)
        spacing = where(spacing > self._config.timeout_s, math.inf, spacing)
        # From rest the first spacing known stands for all three; a pause makes all three unknown.
        anew = (spacing == math.inf) | (last == math.inf)
        fresh = where(anew, spacing, middle), where(anew, spacing, last), spacing
        a, b, c = (where(timed, new, old) for new, old in zip(fresh, (oldest, middle, last), strict=True))
        median = maximum(minimum(a, b), minimum(maximum(a, b), c))
        self._ticks[rows] += counted
        self._stamp[rows] = where(timed, stamp, before)
        self._median[rows] = median
        for values, value in zip(self._spacing, (a, b, c), strict=True):
            values[rows] = value

    def speed(self, time_s: Array | float) -> Values:
        """Speed (n,), m/s, without sign, at a time (n,) or scalar, s; the number of a car alone."""
        waited, config = pick(time_s, self._everyone) - pick(self._stamp, self._everyone), self._config
        speed = config.metres_per_tick / maximum(pick(self._median, self._everyone), waited)
        return where(waited > config.timeout_s, 0.0, speed)

    @property
    def ticks(self) -> Index:
        """Edges counted since reset, (n,)."""
        return self._ticks.copy()

    @property
    def distance(self) -> Values:
        """Distance counted since reset, forward and backward alike, (n,) m; the number of a car alone."""
        return pick(self._ticks, self._everyone) * self._config.metres_per_tick


WINDOW_S = 0.15
"""`WindowSpeed` looks back for so long, s."""


class WindowSpeed:
    """Speed of a sensor that tells a distance at any time, and no edges: that over the last `WINDOW_S`.

    The other law, `EdgeSpeed`, needs the times of edges.
    """

    def __init__(self, max_speed: float) -> None:
        """Begin at a standstill; no speed is told above the largest, m/s."""
        self._max_speed = max_speed
        self._way: deque[tuple[float, float]] = deque()

    def take(self, distance: float, now: float) -> None:
        """Take a distance, m, at a time, s."""
        self._way.append((now, distance))
        while len(self._way) > 2 and self._way[1][0] <= now - WINDOW_S:
            self._way.popleft()

    def speed(self, now: float) -> float:
        """Speed at a time, s, in m/s; it falls while no distance comes."""
        if len(self._way) < 2:
            return 0.0
        begun_s, begun = self._way[0]
        return min((self._way[-1][1] - begun) / max(now - begun_s, WINDOW_S), self._max_speed)


class Hall:
    """The hall sensors of n simulated cars: from the travel of the wheel to edges, and by `EdgeSpeed` to readings."""

    def __init__(self, n: int, config: HallConfig) -> None:
        """Put n cars at rest, distance 0."""
        self._config, self._everyone = config, everyone(n)
        self._edges = EdgeSpeed(n, config)
        self._place = np.zeros(n)
        self._passed = np.zeros(n)
        self._speed = np.zeros(n)
        self.reset(np.arange(n))

    def count_by(self, edges: EdgeSpeed) -> None:
        """Let another counter count the edges from now on: one that also hands them on, for example."""
        self._edges = edges

    def reset(self, rows: Index, place: Array | float = 0.5) -> None:
        """Put cars at rest, distance 0.

        Args:
            rows: (k,) the cars.
            place: (k,) or scalar in [0, 1): where between two magnets the wheel stands. In the middle (default) the
                distance is wrong by at most half a tick either way.
        """
        self._edges.reset(rows)
        self._place[rows] = place
        self._passed[rows] = 0.0
        self._speed[rows] = 0.0

    def update(
        self,
        travel: Array,
        time_s: Array | float,
        period_s: float,
        uniform: Array,
        miss_rate: Array | float = 0.0,
        double_rate: Array | float = 0.0,
    ) -> None:
        """Advance by one period.

        The place p of the wheel is counted in ticks, and magnets sit at the whole numbers. A wheel that turns evenly
        from p0 to p1 in the period T passes magnet m at ``t - T + T (m - p0) / (p1 - p0)``, the time of its edge.

        Args:
            travel: (n,) travel of the wheel's rim in this period, m; backward travel may be negative or positive, the
                sensor does not tell them apart.
            time_s: (n,) or scalar, time at the end of the period, s.
            period_s: T, length of the period, s.
            uniform: (n, 2) numbers in [0, 1): missed, doubled.
            miss_rate: (n,) or scalar, probability that a tick is not counted.
            double_rate: (n,) or scalar, probability that a tick is counted twice.
        """
        rows = self._everyone
        start, passed = pick(self._place, rows), pick(self._passed, rows)
        travel, time_s, miss_rate, double_rate = (
            pick(values, rows) for values in (travel, time_s, miss_rate, double_rate)
        )
        place = start + travel / self._config.metres_per_tick
        now = floor(place)
        count = abs(now - passed)
        if is_any(count > 0):
            for k in range(int(largest(count))):
                moved = where(count > k, place - start, 1.0)
                magnet = where(moved > 0, passed + 1 + k, passed - k)
                when = time_s - period_s + (magnet - start) / moved * period_s
                # Ticks after the first of a period turn the same draws by the golden ratio: uniform again.
                missed, doubled = ((draw + k * _GOLDEN) % 1.0 for draw in columns(uniform, rows))
                seen = (count > k) & (missed >= miss_rate)
                self._edges.edge(seen, when)
                self._edges.edge(seen & (doubled < double_rate), when + self._config.bounce_s)
        self._place[rows], self._passed[rows] = place, now
        self._speed[rows] = self._edges.speed(time_s)

    @property
    def ticks(self) -> Index:
        """Ticks counted since reset, (n,)."""
        return self._edges.ticks

    @property
    def distance(self) -> Array:
        """Distance counted since reset, forward and backward alike, (n,) m."""
        told: Array = as_rows(self._edges.distance)
        return told

    @property
    def speed(self) -> Array:
        """Speed at the end of the last period, without sign, (n,) m/s."""
        return self._speed.copy()

    def readings(self) -> dict[str, Values]:
        """``distance`` and ``speed``, (n,) each, or the numbers of a car alone."""
        return {"distance": self._edges.distance, "speed": pick(self._speed, self._everyone)}
