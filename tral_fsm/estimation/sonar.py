"""What is kept of each ultrasonic: the last reading, the one before, and whether this tick brought a new one."""

from __future__ import annotations

import math
from typing import NamedTuple

from tral_env.interface import MAX_AGE_S, NO_ECHO_M

MAX_ECHO_RANGE_M = NO_ECHO_M - 0.01
"""A shorter range is an echo, m."""


def is_new(age: float, age_before: float) -> bool:
    """A reading is new unless it only grew older since the tick before.

    How much older says nothing: a tick that follows a late one may come a millisecond after it.
    """
    return age < MAX_AGE_S and age <= age_before


class SonarReading(NamedTuple):
    """The last reading of one ultrasonic."""

    range: float = NO_ECHO_M
    """m; 6: no echo."""
    new: bool = False
    """This tick brought it."""
    previous: float = NO_ECHO_M
    """The raw reading before, m."""
    interval: float = 0.0
    """Time between those two, s; 0 before there were two."""

    @property
    def echo(self) -> bool:
        """Something answered."""
        return self.range < MAX_ECHO_RANGE_M


class Sonar:
    """Makes readings of ranges and ages, for one ultrasonic."""

    __slots__ = ("_fired", "age", "reading")

    def __init__(self) -> None:
        self.reading = SonarReading()
        self.age = MAX_AGE_S
        """s since the sensor fired."""
        self._fired = math.nan

    def update(self, range_m: float, age: float, time: float) -> SonarReading:
        """Take the range [m] and its age [s] of this tick.

        Args:
            range_m: m.
            age: s.
            time: s since reset.
        """
        before, self.age = self.age, age
        reading = self.reading
        if age > before or age >= MAX_AGE_S:  # not `is_new`: a call would cost more than all of this
            if reading.new:
                self.reading = reading = SonarReading(reading.range, False, reading.previous, reading.interval)
            return reading
        fired = time - age
        interval = 0.0 if math.isnan(self._fired) else fired - self._fired
        self._fired = fired
        self.reading = SonarReading(range_m, True, reading.range, interval)
        return self.reading
