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
from tral_fsm.estimation import kalman
from tral_fsm.estimation.kalman import Row
from tral_fsm.estimation.odometry import CURVATURE_PER_STEERING, GAIN_SIGMA, TRIM_SIGMA, OdometrySample

MAX_WALL_RANGE_M = 2.2
"""A larger range is no wall of the corridor the car is in, m. Source: corridors up to 2.6 m, the car 0.2 m wide."""
MAX_ECHO_ANGLE = math.radians(18.0)
"""A wall met at a larger angle may give no echo, or a post beside it gives one: no reading counts, rad. Source: 20 to
25 degrees, less the doubt about the heading."""
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
_BOX_WALK = 0.2
"""Standard deviation by which the place of what may be a box wanders in a metre, m: boxes stand askew and have edges.
Source: choice, 10 cm over a box of 30 cm."""
_HALL_ERROR = 0.05
"""Share of the way that the hall sensor may be wrong by."""
_HALL_WAY_M = 0.04
"""Over this way that error is the same, m: about that between two readings. Source: choice."""
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

_HEADING, _TRIM, _GAIN, _LEFT, _RIGHT = range(5)
"""Places of the unknowns in x."""
_H_LEFT, _H_RIGHT = (0.0, 0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 0.0, 1.0)
"""Each ultrasonic measures the error of its own range."""
_R = _RANGE_SIGMA * _RANGE_SIGMA
"""Variance of a reading, m^2."""


class Correction(NamedTuple):
    """By how much dead reckoning is wrong: what is to be added."""

    heading: float = 0.0
    """rad."""
    trim: float = 0.0
    """In units of steering."""
    gain: float = 0.0
    """Of the steering gain."""


NO_CORRECTION = Correction()


def to_left(dx: float, dy: float, along: float) -> float:
    """How far a way (dx, dy) [m] leads to the left of a direction `along` [rad], m."""
    return math.cos(along) * dy - math.sin(along) * dx


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
    """Readings that found no wall while the car stood parallel enough to hear one, since there was one. A wall that is
    found beyond an opening counts only from the next reading of it on."""
    moved: int = 0
    """Counts how often the wall was found anew at another place."""

    @property
    def known(self) -> bool:
        """There is a wall."""
        return not math.isnan(self.range)

    def range_from(self, x: float, y: float, along: float) -> float:
        """Range at another place x, y [m] of dead reckoning, in a corridor of direction `along` [rad]; NaN: no wall."""
        return self.range - self.sign * to_left(x - self.x, y - self.y, along)


class Wall:
    """Tracks the wall on one side.

    It is `known` while it has a range. A reading *fits* within the gate of the filter or 2 cm of that range. It is
    *far* above 2.2 m, or 45 cm beyond the wall or the one that is gone; a far one adds 1 to `lost`. Readings that do
    not fit *agree* within 4 cm of each other.

    | state   | reading fits                  | far                    | third one that agrees               |
    | ------- | ----------------------------- | ---------------------- | ----------------------------------- |
    | unknown | -                             | unknown                | known there, `moved` + 1, `lost` 0  |
    | known   | known, corrected, `lost` 0    | known; unknown after 2 | likewise; `slip` if it was new      |

    A third one that is far itself leaves `lost` as it is: an opening that has a wall behind it is one all the same.
    """

    __slots__ = (
        "_candidate",
        "_gone",
        "_readings",
        "_replaces",
        "_support",
        "_x",
        "_y",
        "lost",
        "moved",
        "range",
        "sign",
        "slip",
    )

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
        """A wall that was found at another place so soon, m: how far left of its reckoned place the car is if the wall
        has not moved."""
        self._readings = 0
        self._support = 0
        self._replaces = False
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

    @property
    def walk(self) -> float:
        """Standard deviation by which its place wanders in a metre, m.

        What has taken the place of another wall may be a box, until it has been there for a while.
        """
        return _BOX_WALK if self._replaces and not self.steady else _WALL_WALK

    def move(self, left: float) -> None:
        """The ultrasonic has moved by so much to the left of the corridor's direction, m; NaN: not known."""
        nearer = self.sign * left
        self.range -= nearer
        self._candidate -= nearer
        self._gone -= nearer

    def put(self, x: float, y: float) -> None:
        """The ultrasonic was at x, y [m] at the last reading."""
        self._x, self._y = x, y

    def fits(self, reading: float, S: float) -> bool:
        """Whether a reading [m] whose innovation has a variance S [m^2] is of this wall."""
        error = reading - self.range
        return abs(error) <= _JUMP_M or kalman.gate_accepts(error, S, _GATE_SIGMAS)

    def accept(self, reading: float, S: float) -> bool:
        """Take a reading [m] whose innovation has a variance S [m^2].

        Returns:
            Whether the reading is of this wall. If not, it may begin or end one.
        """
        self.slip = 0.0
        if self.fits(reading, S):
            self.lost = self._support = 0
            self._candidate = math.nan
            self._readings += 1
            return True
        opening = reading > MAX_WALL_RANGE_M or reading - self._last_known > _OPENING_M
        if opening:
            self._lose()
        if reading > MAX_WALL_RANGE_M:
            self._candidate = math.nan
        elif self._settle(reading) and not opening:
            self.lost = 0
        return False

    @property
    def _last_known(self) -> float:
        """Range of the wall, or of the one that is gone, m; NaN: there was none."""
        return self._gone if math.isnan(self.range) else self.range

    def _lose(self) -> None:
        """One more reading without the wall: after two it is gone."""
        self.lost += 1
        if not math.isnan(self.range):
            self._gone = self.range
        if self.lost >= 2:
            self.range = math.nan
            self._readings = 0

    def _settle(self, reading: float) -> bool:
        """Believe in a new place of the wall once enough readings agree on it; gives whether they do now."""
        if abs(reading - self._candidate) <= 2.0 * _JUMP_M:
            self._support += 1
            self._candidate += (reading - self._candidate) / self._support
        else:
            self._candidate, self._support = reading, 1
        if self._support < _MIN_SUPPORT:
            return False
        self._replaces = abs(self._candidate - self._last_known) > 2.0 * _JUMP_M
        if 0 < self._readings < _MIN_STEADY:
            self.slip = self.sign * (self.range - self._candidate)
        self.range, self._readings = self._candidate, self._support
        self._candidate, self._support = math.nan, 0
        self.moved += 1
        return True


class WallFilter:
    """Both walls and the direction of the corridor between them: an extended Kalman filter.

    Its unknowns x are errors: of the heading, of the trim, of the steering gain, of the left and of the right range.
    Over a way s on which the wheels turned the car by q, with c the curvature of a unit of steering, b the place of the
    side ultrasonics before the rear axle and m = b + s / 2 the lever from there to the middle of the way,

            |  1     -c s     q    0  0 |
            |  0       1      0    0  0 |
        F = |  0       0      1    0  0 |
            | -s    m c s   -m q   1  0 |
            |  s   -m c s    m q   0  1 |

                                                | wl + d    -d   |
        Q = diag(heading noise, trim noise, 0,  |                | )
                                                |   -d    wr + d |

    A wrong trim and a wrong gain turn the car, a wrong heading moves it. wl and wr are how the walls wander: one that
    has just taken the place of another may be a box, and tells little of the heading. d is what the hall sensor adds
    where the car drives at a slant, to one range as much as it takes from the other. F is that of small angles: it
    takes c at straight ahead (at full lock it is 1.16 times as large), a gain of 1, and a way that does not depend on
    the curvature. Each reading measures one range: h = (0, 0, 0, 1, 0) on the left, (0, 0, 0, 0, 1) on the right.
    """

    __slots__ = ("P", "_sample", "_slip", "_x", "_y", "_yaw", "left", "right")

    def __init__(self) -> None:
        self.left = Wall(1.0)
        self.right = Wall(-1.0)
        self._slip = 0.0
        self._sample = OdometrySample(0.0, 0.0, 0.0)
        self._x = self._y = self._yaw = math.nan
        self.P = kalman.diagonal((_HEADING_SIGMA, TRIM_SIGMA, GAIN_SIGMA, _WALL_SIGMA, _WALL_SIGMA))
        """Covariance of heading [rad], trim, steering gain, left and right range [m], (5, 5)."""

    def forget(self) -> None:
        """The car has turned out of the corridor: none of its walls is beside it any more."""
        self.left.forget()
        self.right.forget()
        self._slip = 0.0

    def doubt_direction(self) -> None:
        """The corridor's direction was found to be wrong."""
        self.P = kalman.renew(self.P, _HEADING, _HEADING_SIGMA)
        self._slip = 0.0

    @property
    def direction_known(self) -> bool:
        """The corridor's direction is known."""
        return kalman.sigma(self.P, _HEADING) < _KNOWN_HEADING

    @property
    def trim_sigma(self) -> float:
        """Standard deviation of the trim, in units of steering."""
        return kalman.sigma(self.P, _TRIM)

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
        x, y = self._x, self._y
        self._put(sample.x, sample.y, sample.yaw)
        left = to_left(self._x - x, self._y - y, along)
        self.left.move(left)
        self.right.move(left)
        side, h = (_LEFT, _H_LEFT) if wall is self.left else (_RIGHT, _H_RIGHT)
        if abs(heading) > MAX_ECHO_ANGLE:
            return NO_CORRECTION
        Ph, S = kalman.innovation(self.P, h, _R)
        moved = wall.moved
        if wall.accept(reading, S):
            if wall.steady:
                self._slip = 0.0
            return self._correct(reading - wall.range, Ph, S)
        if wall.moved != moved:
            self.P = kalman.renew(self.P, side, _WALL_SIGMA)
        self._slip = 0.0 if wall.steady else self._slip + wall.slip
        if abs(self._slip) > _MAX_SLIP_M:
            self.doubt_direction()
        return NO_CORRECTION

    def correct_heading(self, turn: float) -> None:
        """The car's heading at the last reading was wrong by a turn [rad], which no range tells of that reading."""
        self._put(self._sample.x, self._sample.y, self._yaw + turn)

    def _put(self, x: float, y: float, yaw: float) -> None:
        """The side ultrasonics are where a car at x, y [m] and yaw [rad] has them."""
        self._yaw = yaw
        self._x = x = x + SIDE_SONAR_X_M * math.cos(yaw)
        self._y = y = y + SIDE_SONAR_X_M * math.sin(yaw)
        self.left.put(x, y)
        self.right.put(x, y)

    def _predict(self, sample: OdometrySample, slant: float) -> None:
        """Let the doubt grow with the way to a sample, driven at a slant (sine) to the corridor."""
        before, self._sample = self._sample, sample
        s, q = sample.arc_length - before.arc_length, sample.heading_change - before.heading_change
        cs, m = CURVATURE_PER_STEERING * s, SIDE_SONAR_X_M + s / 2.0
        hall = _HALL_WAY_M * abs(s) * (_HALL_ERROR * slant) ** 2
        left, right = self.left.walk, self.right.walk
        F = (
            (_HEADING, _TRIM, -cs), (_HEADING, _GAIN, q),
            (_LEFT, _HEADING, -s), (_LEFT, _TRIM, m * cs), (_LEFT, _GAIN, -m * q),
            (_RIGHT, _HEADING, s), (_RIGHT, _TRIM, -m * cs), (_RIGHT, _GAIN, m * q),
        )  # fmt: skip
        Q = (
            (_HEADING, _HEADING, sample.heading_noise(before)), (_TRIM, _TRIM, sample.trim_noise(before)),
            (_LEFT, _LEFT, left * left * abs(s) + hall), (_LEFT, _RIGHT, -hall),
            (_RIGHT, _RIGHT, right * right * abs(s) + hall),
        )  # fmt: skip
        self.P = kalman.predict(self.P, F, Q)

    def _correct(self, y: float, Ph: Row, S: float) -> Correction:
        """Put the ranges right by the innovation y [m] of one, and give what is wrong elsewhere."""
        (heading, trim, gain, left, right), self.P = kalman.update(self.P, y, Ph, S)
        self.left.range += left
        self.right.range += right
        return Correction(heading, trim, gain)
