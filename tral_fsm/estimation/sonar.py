"""What a machine keeps of each sensor: the last reading, and whether this tick brought a new one."""

from __future__ import annotations

import math

from tral_env.interface import CONTROL_PERIOD_S, MAX_AGE_S, NO_ECHO_M

HEARD_M = NO_ECHO_M - 0.01
"""A shorter range is an echo, m."""
_HALF_CAR_M = 0.1
"""Half of the car's width, m."""
_LEAST_ROOM_M = 0.03
"""However narrow a gate is, no way ends more exactly, m."""
_HALF_PERIOD = CONTROL_PERIOD_S / 2.0


def is_new(age: float, age_before: float) -> bool:
    """A reading is new unless it only grew older by the tick since."""
    return age < MAX_AGE_S and age < age_before + _HALF_PERIOD


class Sonar:
    """One ultrasonic sensor: its range now and the reading before."""

    __slots__ = ("age", "fired", "interval", "name", "new", "previous", "range")

    def __init__(self, name: str) -> None:
        self.name = name
        """left, front or right."""
        self.range = NO_ECHO_M
        """m; 6: no echo."""
        self.age = MAX_AGE_S
        """s since the sensor fired."""
        self.new = False
        """This tick brought a new reading."""
        self.previous = NO_ECHO_M
        """The raw reading before, m."""
        self.interval = 0.0
        """Time between those two, s; 0 before there were two."""
        self.fired = math.nan
        """When the sensor fired, s on the machine's clock."""

    def update(self, reading: float, age: float, time: float) -> None:
        """Take the reading [m] and its age [s] of this tick."""
        self.new = new = is_new(age, self.age)
        self.age = age
        if new:
            fired = time - age
            self.previous = self.range
            self.interval = fired - self.fired if self.fired == self.fired else 0.0
            self.fired = fired
            self.range = reading

    @property
    def echo(self) -> bool:
        """Something answered."""
        return self.range < HEARD_M


class Sighting:
    """A gate or marker, kept in the frame of dead reckoning, so that it can be found again when out of view."""

    __slots__ = ("age", "heading", "id", "new", "opening", "x", "y")

    def __init__(self) -> None:
        self.id = -1
        """-1: none yet."""
        self.x = 0.0
        self.y = 0.0
        self.heading = 0.0
        self.opening = math.nan
        """Of a gate, between its boards, m; NaN: not known yet."""
        self.age = MAX_AGE_S
        """s since the image was exposed."""
        self.new = False
        """This tick brought a new image of it."""

    def room(self, margin: float) -> float:
        """How far beside the middle of the gate a car may pass with a margin [m] on either side, m; NaN: not known."""
        half = self.opening / 2.0
        return max(half - _HALF_CAR_M - margin, _LEAST_ROOM_M) if half == half else math.nan
