"""Where the corridor's walls are: an observer that compares each side range with what dead reckoning foretells.

The two side ultrasonics and dead reckoning tell together what neither tells alone: the direction of the corridor, the
clearances to its walls, how the steering must stand to drive straight, and on which side the wall has ended. A door
frame, a recess or a wrong reading is a jump that dead reckoning did not foretell: it moves nothing, unless the next
readings agree with it; then it is the wall's new place.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tral_fsm.control.laws import WHEELBASE
from tral_fsm.estimation.odometry import BEND_PER_STEERING, LOCK_DEVIATION, TRIM_DEVIATION, Stand, learn

SENSOR_X = WHEELBASE / 2.0
"""Side ultrasonics ahead of the rear axle, m."""
REACH = 2.2
"""A range above it is no wall of the corridor the car is in, m. Source: corridors up to 2.6 m, the car 0.2 m wide."""
ECHO_ANGLE = math.radians(18.0)
"""A wall met at a larger angle may give no echo, rad. Source: 20 to 25 degrees, less the doubt about the heading."""
FORGET_ANGLE = math.radians(38.0)
"""Beyond this the car turns out of the corridor, rad; at 45 degrees along becomes across."""
_JUMP = 0.02
"""A change that was not foretold is no matter of heading if it is larger than this, m,"""
_GATE = 3.0
"""and larger than so many deviations."""
_SIGMA = 0.008
"""Deviation of a reading, m. Source: the SRF08's steps of 8.65 mm, jitter."""
_ANEW = 0.02
"""Deviation of a wall's place when it was found anew, m."""
_WALL_WALK = 0.01
"""How far a wall's place wanders in a metre, m."""
_HALL_FAULT = 0.05
"""Share of the way that the hall sensor may be wrong by."""
_SURE = math.radians(2.5)
"""The corridor's direction is known when its deviation is below this, rad."""
_SURE_TRIM = 0.03
"""The trim is known when its deviation is below this, in units of steering: 0.7 degrees."""
_DIRECTION = math.radians(6.0)
"""Deviation of the corridor's direction at the start, and after it was found to be wrong, rad."""
_AGREE = 3
"""So many readings must agree on a new place of the wall."""
_HASTY = 10
"""A wall that moves after fewer readings than this rather seems to move: the car slips."""
_SLIP = 0.2
"""Slips that add up to this on one side or both: the corridor's direction is wrong, m."""
_FAR = 0.45
"""A range that is so much larger than the wall's is an opening, no recess, m."""


class Fault(NamedTuple):
    """By how much dead reckoning is wrong: what is to be added."""

    heading: float
    """rad."""
    trim: float
    """In units of steering."""
    lock: float
    """Of the lock's scale."""


NO_FAULT = Fault(0.0, 0.0, 0.0)


class Wall:
    """The wall on one side."""

    __slots__ = ("_agreed", "_candidate", "_gone", "_readings", "_x", "_y", "lost", "moved", "range", "sign", "slip")

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
        """Readings that found no wall while the car stood parallel enough to hear one, since there was one."""
        self.slip = 0.0
        """How much farther left the car is by this reading, since the wall was found at another place so soon, m."""
        self._readings = 0
        self._agreed = 0
        self._candidate = self._gone = math.nan
        self._x = self._y = math.nan

    @property
    def known(self) -> bool:
        """There is a wall, and where it is."""
        return self.range == self.range

    @property
    def steady(self) -> bool:
        """It has been where it is for a while."""
        return self._readings >= _HASTY

    def _nearer(self, x: float, y: float, along: float) -> float:
        """How much nearer a point is than the place of the last reading, m."""
        return self.sign * (math.cos(along) * (y - self._y) - math.sin(along) * (x - self._x))

    def seen_from(self, x: float, y: float, along: float) -> float:
        """Range at another place x, y [m] of dead reckoning, in a corridor of direction `along` [rad]; NaN: no wall."""
        return self.range - self._nearer(x, y, along)

    def foretell(self, x: float, y: float, along: float) -> None:
        """Move to the place of a new reading."""
        if self._x != self._x:
            self._x, self._y = x, y
            return
        nearer = self._nearer(x, y, along)
        self.range -= nearer
        self._candidate -= nearer
        self._x, self._y = x, y

    def fits(self, reading: float, deviation: float) -> bool:
        """Take a reading [m]; gives whether it is of this wall, by the deviation [m] of what was foretold."""
        error = reading - self.range
        self.slip = 0.0
        if abs(error) <= max(_JUMP, _GATE * deviation):
            self.lost = self._agreed = 0
            self._candidate = math.nan
            self._readings += 1
            return True
        if reading > REACH or error > _FAR:
            self._lose()
            self._candidate = math.nan
        elif self.range != self.range and reading - self._gone > _FAR:
            self._lose()
        if reading <= REACH:
            self._settle(reading)
        return False

    def _lose(self) -> None:
        """One more reading without the wall: after two it is gone."""
        self.lost += 1
        if self.range == self.range:
            self._gone = self.range
        if self.lost >= 2:
            self.range = math.nan
            self._readings = 0

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
    """Both walls and the direction of the corridor between them: an extended Kalman filter.

    Its five unknowns: by how much the heading, the trim, the lock's scale and the two ranges are wrong.
    """

    __slots__ = ("_covariance", "_slip", "_stand", "left", "right")

    def __init__(self) -> None:
        self.left = Wall(1.0)
        self.right = Wall(-1.0)
        self._slip = 0.0
        self._stand = Stand(0.0, 0.0, 0.0)
        self._covariance = [[0.0] * 5 for _ in range(5)]
        for i, deviation in enumerate((_DIRECTION, TRIM_DEVIATION, LOCK_DEVIATION, _ANEW, _ANEW)):
            self._covariance[i][i] = deviation * deviation

    def forget(self) -> None:
        """The car has turned out of the corridor: none of its walls is beside it any more."""
        self.left.forget()
        self.right.forget()
        self._slip = 0.0

    def doubt_direction(self) -> None:
        """The corridor's direction was found to be wrong."""
        self._renew(0, _DIRECTION)
        self._slip = 0.0

    def side(self, is_left: bool) -> Wall:
        """Wall on that side."""
        return self.left if is_left else self.right

    @property
    def direction_known(self) -> bool:
        """The corridor's direction is known."""
        return self._covariance[0][0] < _SURE * _SURE

    @property
    def trim_deviation(self) -> float:
        """Standard deviation of the trim."""
        return math.sqrt(self._covariance[1][1])

    @property
    def sure(self) -> bool:
        """The corridor's direction is known, and at which steering the car drives straight."""
        return self.direction_known and self.trim_deviation < _SURE_TRIM

    def take(self, wall: Wall, reading: float, stand: Stand, along: float) -> Fault:
        """Take a reading of a side ultrasonic.

        Args:
            wall: the side.
            reading: m.
            stand: where the car was when the sensor fired.
            along: direction of the corridor in dead reckoning, rad.

        Returns:
            What is to be added to the heading, the trim and the lock's scale.
        """
        heading = stand.yaw - along
        self._drift(stand, math.sin(heading))
        if abs(heading) > FORGET_ANGLE:
            self.forget()
        if abs(heading) > ECHO_ANGLE:
            return NO_FAULT
        wall.foretell(stand.x + SENSOR_X * math.cos(stand.yaw), stand.y + SENSOR_X * math.sin(stand.yaw), along)
        side = 3 if wall is self.left else 4
        variance = self._covariance[side][side] + _SIGMA * _SIGMA
        moved = wall.moved
        if wall.fits(reading, math.sqrt(variance)):
            if wall.steady:
                self._slip = 0.0
            return self._correct(side, reading - wall.range, variance)
        if wall.moved != moved:
            self._renew(side, _ANEW)
        self._slip = 0.0 if wall.steady else self._slip + wall.slip
        if abs(self._slip) > _SLIP:
            self.doubt_direction()
        return NO_FAULT

    def _drift(self, stand: Stand, slant: float) -> None:
        """A wrong trim and a wrong lock turn the car, a wrong heading moves it; the rest of its faults wander."""
        before, self._stand = self._stand, stand
        driven, turned = stand.path - before.path, stand.turned - before.turned
        p = self._covariance
        trim = -BEND_PER_STEERING * driven
        lever = SENSOR_X + driven / 2.0
        for row in p:
            turn = trim * row[1] + turned * row[2]
            shift = driven * row[0] + lever * turn
            row[0] += turn
            row[3] -= shift
            row[4] += shift
        heading, left, right = p[0], p[3], p[4]
        for i, (t, k, h) in enumerate(zip(p[1], p[2], heading, strict=True)):
            turn = trim * t + turned * k
            shift = driven * h + lever * turn
            heading[i] += turn
            left[i] -= shift
            right[i] += shift
        heading[0] += stand.heading_wander(before)
        p[1][1] += stand.trim_wander(before)
        wander = _WALL_WALK * _WALL_WALK * abs(driven) + (_HALL_FAULT * slant * driven) ** 2
        left[3] += wander
        right[4] += wander

    def _correct(self, side: int, error: float, variance: float) -> Fault:
        """Kalman's step for one range."""
        ph = [row[side] for row in self._covariance]
        heading, trim, lock, left, right = (error / variance * x for x in ph)
        learn(self._covariance, ph, variance)
        self.left.range += left
        self.right.range += right
        return Fault(heading, trim, lock)

    def _renew(self, index: int, deviation: float) -> None:
        """Know one unknown by this deviation only."""
        p = self._covariance
        for row in p:
            row[index] = 0.0
        p[index] = [0.0] * 5
        p[index][index] = deviation * deviation
