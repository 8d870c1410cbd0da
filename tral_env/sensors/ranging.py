"""When ultrasonics fire and when their ranges can be read.

A ranger fires, listens, and then holds the range in a register, which the simulated car reads just before the ranger
fires again. So a range is one cadence old when it arrives, and ages until the next one replaces it.
"""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Array, Index, Rows, columns, everyone, minimum, pick
from tral_env.interface import MAX_AGE_S, NO_ECHO_M

SONARS = ("left", "front", "right")
"""The ultrasonics stand in this order along the second axis."""
_NAMES = tuple((f"ultrasonic_{side}", f"ultrasonic_{side}_age") for side in SONARS)
BORESIGHT = np.array([np.pi / 2, 0.0, -np.pi / 2])
"""Each ultrasonic looks in this direction, rad counter-clockwise from the car's x axis."""


class Ranging:
    """Published and pending ranges of n cars with three rangers each."""

    def __init__(self, n: int) -> None:
        """Begin with no echo, of the greatest age."""
        self._everyone = everyone(n)
        self.range_m = np.full((n, len(SONARS)), NO_ECHO_M)
        """(n, 3) ranges that can be read, m."""
        self._fired = np.full((n, len(SONARS)), -MAX_AGE_S)
        self._pending_range = self.range_m.copy()
        self._pending_fired = self._fired.copy()

    def reset(self, rows: Index, range_m: Array) -> None:
        """Publish the ranges (k, 3), m, that the sonars of the rows (k,) measure at time 0."""
        self.range_m[rows] = self._pending_range[rows] = range_m
        self._fired[rows] = self._pending_fired[rows] = 0.0

    def fire(self, rows: Rows, sonars: Index | int, range_m: Array, time_s: Array) -> None:
        """Begin rangings, and publish what the rangings before them found.

        Args:
            rows: (k,) cars.
            sonars: (k,) which of `SONARS`.
            range_m: (k,) what this ranging will find, m.
            time_s: (k,) when it fired, s. A sonar of a car alone is given in numbers.
        """
        at = rows, sonars
        self.range_m[at], self._fired[at] = self._pending_range[at], self._pending_fired[at]
        self._pending_range[at], self._pending_fired[at] = range_m, time_s

    def readings(self, time_s: Array) -> dict[str, Array]:
        """``ultrasonic_left`` .. ``ultrasonic_right_age``; `time_s`, (n,) s, is now.

        A range, m, and the time since it was measured, s: each (n,), or the number of a car alone.
        """
        rows, out = self._everyone, {}
        now, ranges, fired = pick(time_s, rows), columns(self.range_m, rows), columns(self._fired, rows)
        for (name, age), range_m, fired_s in zip(_NAMES, ranges, fired, strict=True):
            out[name], out[age] = range_m, minimum(now - fired_s, MAX_AGE_S)
        return out
