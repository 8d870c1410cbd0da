"""Where the corridor's walls are: an observer that compares each side range with what dead reckoning foretells.

The two side ultrasonics and dead reckoning tell together what neither tells alone: the direction of the corridor, the
clearances to its walls, how the steering must stand to drive straight, and on which side the wall has ended. A door
frame, a recess or a wrong reading is a jump that dead reckoning did not foretell: it moves nothing, unless the next
readings agree with it; then it is the wall's new place.
"""

from __future__ import annotations

import math

from tral_env.interface import NO_ECHO_M
from tral_fsm.control import WHEELBASE, clip

SENSOR_X = WHEELBASE / 2.0
"""Side ultrasonics ahead of the rear axle, m."""
REACH = 2.2
"""A range above it is no wall of the corridor the car is in, m. Source: corridors up to 2.6 m, the car 0.2 m wide."""
ECHO_ANGLE = math.radians(18.0)
"""A wall met at a larger angle may give no echo, rad. Source: 20 to 25 degrees, less the doubt about the heading."""
_PLACE_GAIN = (0.3, 0.2, 0.12)
"""Share of an unforetold centimetre that is believed to be the clearance's: direction new, known, well known."""
FORGET_ANGLE = math.radians(38.0)
"""Beyond this the car turns out of the corridor, rad; at 45 degrees along becomes across."""
_SURE, _SETTLED = 16, 60
"""After so many readings that agree the corridor's direction is known, and well known."""
_TURN_GAIN = (1.4, 0.55, 0.2)
"""Share that is believed to be the heading's, rad/m: an error of 0.55 dies away within 0.4 m. Source: choice."""
_TRIM_GAIN = (0.06, 0.06, 0.02)
"""Share that is believed to be the trim's, steering for a metre."""
_JUMP = 0.02
"""An unforetold change larger than this is no matter of heading, m; twice that while the heading is new."""
_AGREE = 3
"""So many readings must agree on a new place of the wall."""
_HASTY = 10
"""A wall that moves after fewer readings than this rather seems to move: the car slips."""
_SLIP = 0.2
"""Slips that add up to this on one side or both: the corridor's direction is wrong, m."""
_MOST_TURN = (0.05, 0.008, 0.004)
"""The direction is corrected by no more than this at a reading, rad. The last is 6 degrees for a metre."""
_FAR = 0.45
"""A range that is so much larger than the wall's is an opening, no recess, m."""

_AHEAD_JUMP = 0.08
"""What is heard ahead comes nearer by what was driven, give or take this, m."""
_AHEAD_MISSES = 3
"""So many readings in a row may be wrong before something else is ahead."""


class Wall:
    """The wall on one side."""

    __slots__ = ("_agreed", "_candidate", "_readings", "_x", "_y", "drift", "lost", "moved", "range", "sign", "slip")

    def __init__(self, sign: float) -> None:
        self.sign = sign
        """+1 left, -1 right."""
        self.forget()
        self.moved = 0
        """Counts how often the wall was found anew at another place."""

    def forget(self) -> None:
        """Know nothing."""
        self.range = math.nan
        """What the ultrasonic should read now, m; NaN: no wall known."""
        self.lost = 0
        """Readings in a row that found no wall while the car stood parallel enough to hear one."""
        self.drift = math.nan
        """How much farther left the car is than foretold, by the last reading, m; NaN: the reading told nothing."""
        self.slip = 0.0
        """How much farther left the car is by this reading, since the wall was found at another place so soon, m."""
        self._readings = 0
        self._agreed = 0
        self._candidate = math.nan
        self._x = self._y = math.nan

    @property
    def known(self) -> bool:
        """There is a wall, and where it is."""
        return self.range == self.range

    @property
    def steady(self) -> bool:
        """It has been where it is for a while."""
        return self._readings >= _HASTY

    @property
    def open(self) -> bool:
        """Two readings or more found no wall where one would be heard."""
        return self.lost >= 2

    def _nearer(self, x: float, y: float, along: float) -> float:
        """How much nearer a point is than the place of the last reading, m."""
        return self.sign * (math.cos(along) * (y - self._y) - math.sin(along) * (x - self._x))

    def seen_from(self, x: float, y: float, along: float) -> float:
        """Range at another place x, y [m] of dead reckoning, in a corridor of direction `along` [rad]; NaN: no wall."""
        return self.range - self._nearer(x, y, along)

    def foretell(self, x: float, y: float, along: float) -> float:
        """Move to the place of a new reading; gives the distance since the last one, m."""
        if self._x != self._x:
            self._x, self._y = x, y
            return 0.0
        step = math.hypot(x - self._x, y - self._y)
        nearer = self._nearer(x, y, along)
        self.range -= nearer
        self._candidate -= nearer
        self._x, self._y = x, y
        return step

    def take(self, reading: float, stage: int) -> None:
        """Take a reading [m] in a stage: the corridor's direction is 0 new, 1 known, 2 well known."""
        error = reading - self.range
        self.drift = math.nan
        self.slip = 0.0
        if abs(error) <= (_JUMP if stage else 2.0 * _JUMP):
            self.lost = self._agreed = 0
            self._candidate = math.nan
            self._readings += 1
            self.range += max(_PLACE_GAIN[stage], 1.0 / self._readings) * error
            self.drift = -self.sign * error
            return
        if reading > REACH or error > _FAR:
            self.lost += 1
            self._candidate = math.nan
            if self.lost >= 2:
                self.range = math.nan
                self._readings = 0
        if reading <= REACH:
            self._settle(reading)

    def _settle(self, reading: float) -> None:
        """Believe in a new place of the wall once enough readings agree on it."""
        if abs(reading - self._candidate) <= 2.0 * _JUMP:
            self._agreed += 1
            self._candidate += (reading - self._candidate) / self._agreed
        else:
            self._candidate, self._agreed = reading, 1
        if self._agreed >= _AGREE:
            if 0 < self._readings < _HASTY:
                self.slip = self.sign * (self.range - self._candidate)
            self.range, self._readings, self.lost = self._candidate, self._agreed, 0
            self._candidate, self._agreed = math.nan, 0
            self.moved += 1


class Walls:
    """Both walls and the direction of the corridor between them."""

    __slots__ = ("_agreed", "_slip", "left", "right")

    def __init__(self) -> None:
        self.left = Wall(1.0)
        self.right = Wall(-1.0)
        self._agreed = 0
        self._slip = 0.0

    def forget(self) -> None:
        """The car has turned out of the corridor: none of its walls is beside it any more."""
        self.left.forget()
        self.right.forget()
        self._agreed = 0
        self._slip = 0.0

    def side(self, is_left: bool) -> Wall:
        """Wall on that side."""
        return self.left if is_left else self.right

    @property
    def direction_known(self) -> bool:
        """The corridor's direction is known."""
        return self._agreed > _SURE

    def take(
        self, wall: Wall, reading: float, x: float, y: float, heading: float, corridor_yaw: float
    ) -> tuple[float, float]:
        """Take a reading of a side ultrasonic.

        Args:
            wall: the side.
            reading: m.
            x: of the rear axle when the sensor fired, in dead reckoning, m.
            y: likewise.
            heading: of the car against the corridor then, rad.
            corridor_yaw: direction of the corridor that the heading counts from, in dead reckoning, rad.

        Returns:
            Corrections of the corridor's direction [rad] and of the trim, both + = left.
        """
        if abs(heading) > FORGET_ANGLE:
            self.forget()
        if abs(heading) > ECHO_ANGLE:
            return 0.0, 0.0
        yaw = corridor_yaw + heading
        step = wall.foretell(x + SENSOR_X * math.cos(yaw), y + SENSOR_X * math.sin(yaw), corridor_yaw)
        stage = (self._agreed >= _SURE) + (self._agreed >= _SETTLED)
        wall.take(reading, stage)
        self._slip = 0.0 if wall.steady else self._slip + wall.slip
        if abs(self._slip) > _SLIP:
            self._agreed, self._slip = 0, 0.0
        drift = self._common(wall, stage)
        if drift != drift:
            return 0.0, 0.0
        self._agreed += 1
        share = -drift * min(step / 0.04, 1.0)
        return clip(_TURN_GAIN[stage] * share, _MOST_TURN[stage]), _TRIM_GAIN[stage] * share

    def _common(self, wall: Wall, stage: int) -> float:
        """Drift [m] that both walls agree on: an edge or a recess on one side looks like one, but not from the other.

        NaN if the reading told nothing. Of two drifts to the same side the smaller one. If they contradict each other:
        that of the nearer wall while the direction is new, since openings are far; 0 later.
        """
        other = self.right if wall is self.left else self.left
        if wall.drift != wall.drift or other.drift != other.drift:
            return wall.drift
        if wall.drift * other.drift > 0.0:
            return min(wall.drift, other.drift, key=abs)
        return wall.drift if stage == 0 and wall.range < other.range else 0.0


class Ahead:
    """What the front ultrasonic hears: from how far on it has been heard tells a wall from a box.

    A wall across the corridor answers from 5 m on. A box that is turned, or beside the car's way, is heard by its edges
    alone, from 2 m on.
    """

    __slots__ = (
        "_begin",
        "_driven",
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
        """Range at which it was first heard, m."""
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

    def take(self, reading: float, driven: float) -> None:
        """Take a reading [m] after so many metres `driven`."""
        foretold = self.last - (driven - self._last_driven)
        self.run = self.run + 1 if -_AHEAD_JUMP <= reading - foretold <= _AHEAD_JUMP else 1
        self.last, self._last_driven = reading, driven
        foretold = self._range - (driven - self._driven)
        if -_AHEAD_JUMP <= reading - foretold <= _AHEAD_JUMP:
            self._missed = 0
            self._range, self._driven = reading, driven
            self.range = reading
            self._sum(reading, driven)
        elif self._missed < _AHEAD_MISSES and foretold < math.inf:
            self._missed += 1
        else:
            self._missed = 0
            self._range, self._driven = (reading, driven) if reading < NO_ECHO_M - 0.01 else (math.inf, driven)
            self.heard_from, self.range = self._range, math.inf
            self._begin, self._sums = driven, (0.0, 0.0, 0.0, 0.0, 0.0)
            if self._range < math.inf:
                self._sum(reading, driven)

    def _sum(self, reading: float, driven: float) -> None:
        """Add to the sums of the line z = r^2 - s^2 over s."""
        s = driven - self._begin
        z = reading * reading - s * s
        n, ss, s2, sz, zs = self._sums
        self._sums = n + 1.0, ss + s, s2 + s * s, sz + z, zs + z * s

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
