"""Where the corridor's walls are: a Kalman filter that compares each side range with what dead reckoning predicts.

The two side ultrasonics and dead reckoning tell together what neither tells alone: the direction of the corridor, the
clearances to its walls, how the steering must stand to drive straight, and on which side the wall has ended. A door
frame, a recess or a wrong reading is a jump that dead reckoning did not predict: it moves nothing, unless the next
readings agree with it; then it is the wall's new place.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tral_env.geometry import SIDE_SONAR_X_M
from tral_fsm.estimation.odometry import CURVATURE_PER_STEERING, GAIN_SIGMA, TRIM_SIGMA, OdometrySample

MAX_WALL_RANGE_M = 2.2
"""A larger range is no wall of the corridor the car is in, m. Source: corridors up to 2.6 m, the car 0.2 m wide."""
MAX_ECHO_ANGLE = math.radians(18.0)
"""A wall met at a larger angle may give no echo, rad. Source: 20 to 25 degrees, less the doubt about the heading."""
MAX_CORRIDOR_ANGLE = math.radians(38.0)
"""Beyond this the car turns out of the corridor, rad; at 45 degrees along becomes across."""
_JUMP_M = 0.02
"""A change that was not predicted is no matter of heading if it is larger than this, m, and larger than the gate."""
_GATE_SIGMAS = 3.0
"""Innovations of so many standard deviations are accepted."""
_RANGE_SIGMA = 0.008
"""Standard deviation of a reading, m. Source: the SRF08's steps of 8.65 mm, jitter."""
_WALL_SIGMA = 0.02
"""Standard deviation of a wall's place when it was found anew, m."""
_WALL_WALK = 0.01
"""Standard deviation by which a wall's place wanders in a metre, m."""
_HALL_ERROR = 0.05
"""Share of the way that the hall sensor may be wrong by."""
_KNOWN_HEADING = math.radians(2.5)
"""The corridor's direction is known when its standard deviation is below this, rad."""
_KNOWN_TRIM = 0.03
"""The trim is known when its standard deviation is below this, in units of steering: 0.7 degrees."""
_HEADING_SIGMA = math.radians(6.0)
"""Standard deviation of the corridor's direction at the start, and after it was found to be wrong, rad."""
_MIN_SUPPORT = 3
"""So many readings must agree on a new place of the wall."""
_MIN_STEADY = 10
"""A wall that moves after fewer readings than this only seems to move: the car slips."""
_MAX_SLIP_M = 0.2
"""Slips that add up to this on one side or both: the corridor's direction is wrong, m."""
_OPENING_M = 0.45
"""A range that is so much larger than the wall's is an opening, no recess, m."""


class Correction(NamedTuple):
    """By how much dead reckoning is wrong: what is to be added."""

    heading: float = 0.0
    """rad."""
    trim: float = 0.0
    """In units of steering."""
    gain: float = 0.0
    """Of the steering gain."""


NO_CORRECTION = Correction()


class WallEstimate(NamedTuple):
    """The wall on one side, as it is known now."""

    sign: float
    """+1 left, -1 right."""
    range: float = math.nan
    """What the ultrasonic should read at x, y, m; NaN: no wall known."""
    x: float = math.nan
    """Place of the ultrasonic at the last reading, in dead reckoning, m."""
    y: float = math.nan
    """m."""
    lost: int = 0
    """Readings that found no wall while the car stood parallel enough to hear one, since there was one."""
    moved: int = 0
    """Counts how often the wall was found anew at another place."""

    @property
    def known(self) -> bool:
        """There is a wall."""
        return not math.isnan(self.range)

    def range_from(self, x: float, y: float, along: float) -> float:
        """Range at another place x, y [m] of dead reckoning, in a corridor of direction `along` [rad]; NaN: no wall."""
        return self.range - self.sign * (math.cos(along) * (y - self.y) - math.sin(along) * (x - self.x))


class Wall:
    """Tracks the wall on one side."""

    __slots__ = ("_candidate", "_gone", "_readings", "_support", "_x", "_y", "lost", "moved", "range", "sign", "slip")

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
        """See `WallEstimate.lost`."""
        self.slip = 0.0
        """How much farther left the car is by this reading, since the wall was found at another place so soon, m."""
        self._readings = 0
        self._support = 0
        self._candidate = self._gone = math.nan
        self._x = self._y = math.nan

    @property
    def estimate(self) -> WallEstimate:
        """The wall as it is known now."""
        return WallEstimate(self.sign, self.range, self._x, self._y, self.lost, self.moved)

    @property
    def steady(self) -> bool:
        """It has been where it is for a while."""
        return self._readings >= _MIN_STEADY

    def predict(self, x: float, y: float, along: float) -> None:
        """Move to the place of a new reading."""
        if math.isnan(self._x):
            self._x, self._y = x, y
            return
        nearer = self.sign * (math.cos(along) * (y - self._y) - math.sin(along) * (x - self._x))
        self.range -= nearer
        self._candidate -= nearer
        self._x, self._y = x, y

    def accept(self, reading: float, deviation: float) -> bool:
        """Take a reading [m] whose innovation has a standard deviation [m].

        Returns:
            Whether the reading is of this wall. If not, it may begin or end one.
        """
        error = reading - self.range
        self.slip = 0.0
        if abs(error) <= max(_JUMP_M, _GATE_SIGMAS * deviation):
            self.lost = self._support = 0
            self._candidate = math.nan
            self._readings += 1
            return True
        if reading > MAX_WALL_RANGE_M or error > _OPENING_M:
            self._lose()
            self._candidate = math.nan
        elif math.isnan(self.range) and reading - self._gone > _OPENING_M:
            self._lose()
        if reading <= MAX_WALL_RANGE_M:
            self._settle(reading)
        return False

    def _lose(self) -> None:
        """One more reading without the wall: after two it is gone."""
        self.lost += 1
        if not math.isnan(self.range):
            self._gone = self.range
        if self.lost >= 2:
            self.range = math.nan
            self._readings = 0

    def _settle(self, reading: float) -> None:
        """Believe in a new place of the wall once enough readings agree on it."""
        if abs(reading - self._candidate) <= 2.0 * _JUMP_M:
            self._support += 1
            self._candidate += (reading - self._candidate) / self._support
        else:
            self._candidate, self._support = reading, 1
        if self._support >= _MIN_SUPPORT:
            if 0 < self._readings < _MIN_STEADY:
                self.slip = self.sign * (self.range - self._candidate)
            self.range, self._readings, self.lost = self._candidate, self._support, 0
            self._candidate, self._support = math.nan, 0
            self.moved += 1


class WallFilter:
    """Both walls and the direction of the corridor between them: an extended Kalman filter.

    Its five unknowns: by how much the heading, the trim, the steering gain and the two ranges are wrong.
    """

    __slots__ = ("_covariance", "_sample", "_slip", "left", "right")

    def __init__(self) -> None:
        self.left = Wall(1.0)
        self.right = Wall(-1.0)
        self._slip = 0.0
        self._sample = OdometrySample(0.0, 0.0, 0.0)
        self._covariance = [[0.0] * 5 for _ in range(5)]
        for i, sigma in enumerate((_HEADING_SIGMA, TRIM_SIGMA, GAIN_SIGMA, _WALL_SIGMA, _WALL_SIGMA)):
            self._covariance[i][i] = sigma * sigma

    def forget(self) -> None:
        """The car has turned out of the corridor: none of its walls is beside it any more."""
        self.left.forget()
        self.right.forget()
        self._slip = 0.0

    def doubt_direction(self) -> None:
        """The corridor's direction was found to be wrong."""
        self._renew(0, _HEADING_SIGMA)
        self._slip = 0.0

    @property
    def direction_known(self) -> bool:
        """The corridor's direction is known."""
        return self._covariance[0][0] < _KNOWN_HEADING * _KNOWN_HEADING

    @property
    def covariance(self) -> tuple[tuple[float, ...], ...]:
        """Covariance of heading [rad], trim, steering gain, left and right range [m]."""
        return tuple(tuple(row) for row in self._covariance)

    @property
    def trim_sigma(self) -> float:
        """Standard deviation of the trim, in units of steering."""
        return math.sqrt(self._covariance[1][1])

    @property
    def sure(self) -> bool:
        """The corridor's direction is known, and at which steering the car drives straight."""
        return self.direction_known and self.trim_sigma < _KNOWN_TRIM

    def update(self, wall: Wall, reading: float, sample: OdometrySample, along: float) -> Correction:
        """Take a reading of a side ultrasonic.

        Args:
            wall: the side.
            reading: m.
            sample: where the car was when the sensor fired.
            along: direction of the corridor in dead reckoning, rad.

        Returns:
            What is to be added to the heading, the trim and the steering gain.
        """
        heading = sample.yaw - along
        self._predict(sample, math.sin(heading))
        if abs(heading) > MAX_CORRIDOR_ANGLE:
            self.forget()
        if abs(heading) > MAX_ECHO_ANGLE:
            return NO_CORRECTION
        x = sample.x + SIDE_SONAR_X_M * math.cos(sample.yaw)
        y = sample.y + SIDE_SONAR_X_M * math.sin(sample.yaw)
        wall.predict(x, y, along)
        side = 3 if wall is self.left else 4
        variance = self._covariance[side][side] + _RANGE_SIGMA * _RANGE_SIGMA
        moved = wall.moved
        if wall.accept(reading, math.sqrt(variance)):
            if wall.steady:
                self._slip = 0.0
            return self._correct(side, reading - wall.range, variance)
        if wall.moved != moved:
            self._renew(side, _WALL_SIGMA)
        self._slip = 0.0 if wall.steady else self._slip + wall.slip
        if abs(self._slip) > _MAX_SLIP_M:
            self.doubt_direction()
        return NO_CORRECTION

    def _predict(self, sample: OdometrySample, slant: float) -> None:
        """A wrong trim and a wrong gain turn the car, a wrong heading moves it; the rest of its errors is noise."""
        before, self._sample = self._sample, sample
        driven, turned = sample.arc_length - before.arc_length, sample.heading_change - before.heading_change
        p = self._covariance
        trim = -CURVATURE_PER_STEERING * driven
        lever = SIDE_SONAR_X_M + driven / 2.0
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
        heading[0] += sample.heading_noise(before)
        p[1][1] += sample.trim_noise(before)
        noise = _WALL_WALK * _WALL_WALK * abs(driven) + (_HALL_ERROR * slant * driven) ** 2
        left[3] += noise
        right[4] += noise

    def _correct(self, side: int, error: float, variance: float) -> Correction:
        """Kalman's step for one range."""
        ph = [row[side] for row in self._covariance]
        heading, trim, gain, left, right = (error / variance * x for x in ph)
        learn(self._covariance, ph, variance)
        self.left.range += left
        self.right.range += right
        return Correction(heading, trim, gain)

    def _renew(self, index: int, sigma: float) -> None:
        """Know one unknown by this standard deviation only."""
        p = self._covariance
        for row in p:
            row[index] = 0.0
        p[index] = [0.0] * 5
        p[index][index] = sigma * sigma


def learn(covariance: list[list[float]], with_measured: list[float], spread: float) -> None:
    """Kalman's step for the covariance."""
    for row, with_it in zip(covariance, with_measured, strict=True):
        gain = with_it / spread
        for j, other in enumerate(with_measured):
            row[j] -= gain * other
