"""A gate kept in the frame of dead reckoning, and what its sightings say about the car's own steering.

An extended Kalman filter (Welch and Bishop, 2006) with five unknowns: the gate's place (x, y), the heading of its axis,
and by how much the trim and the lock are wrong. A car whose wheels stand a degree off turns by 4 degrees a metre
without knowing; then in the frame of dead reckoning the gate seems to turn about the car. The camera tells a bearing to
a tenth of a degree, so half a metre of approach is enough to learn the trim, and a gate that has left the image is
still known well.
"""

from __future__ import annotations

import math

from tral_env.se2 import wrap
from tral_fsm.estimation.odometry import CURVATURE_PER_STEERING, GAIN_SIGMA, TRIM_SIGMA, OdometrySample
from tral_fsm.estimation.wall_filter import learn

_PLACE_WALK = 0.02
"""How far dead reckoning's place wanders in a metre, m."""
_ALONG = (0.01, 0.015)
_ACROSS = (0.006, 0.003)
_HEADING = (0.01, 0.002)
"""Deviation of a sighting: at no distance, and what each metre (for the heading: its square) adds. Source: the tables
of docs/perception.md, with room for what the image's faults add."""
_GATE_SIGMA = 4.0
"""A sighting farther off than so many deviations is not believed,"""
_ANEW = 3
"""unless so many do not fit, one after the other: then the gate is there."""

_POSTS, _POSTS_ASIDE = (0.8, 0.4), 1.5
"""Posts are heard from so far before the gate to so far behind it, on a way that leads so near to its middle, m."""

Row = list[float]


class GateTracker:
    """One gate, and the covariance of its pose, the trim and the lock."""

    __slots__ = ("_covariance", "_misfits", "_sample", "_trim", "heading", "opening", "x", "y")

    def __init__(self, x: float, y: float, heading: float, sample: OdometrySample, trim: float = TRIM_SIGMA) -> None:
        """Begin with a sighting.

        Args:
            x: of the gate's middle in dead reckoning, m.
            y: likewise.
            heading: of its axis, rad.
            sample: where it was seen from.
            trim: deviation of the trim.
        """
        self.opening = math.nan
        """Between its boards, m; NaN: not known yet."""
        self._trim = trim
        self.begin(x, y, heading, sample)

    def begin(self, x: float, y: float, heading: float, sample: OdometrySample) -> None:
        """Forget all but this sighting."""
        self.x, self.y, self.heading = x, y, heading
        self._sample = sample
        range_ = max(math.hypot(x - sample.x, y - sample.y), 1e-3)
        cos, sin = (x - sample.x) / range_, (y - sample.y) / range_
        along, across, turned = _deviations(range_)
        a, b = along * along, across * across
        shared = (a - b) * sin * cos
        self._covariance: list[Row] = [
            [a * cos * cos + b * sin * sin, shared, 0.0, 0.0, 0.0],
            [shared, a * sin * sin + b * cos * cos, 0.0, 0.0, 0.0],
            [0.0, 0.0, turned * turned, 0.0, 0.0],
            [0.0, 0.0, 0.0, self._trim * self._trim, 0.0],
            [0.0, 0.0, 0.0, 0.0, GAIN_SIGMA * GAIN_SIGMA],
        ]
        self._misfits = 0

    def update(self, x: float, y: float, heading: float, sample: OdometrySample) -> tuple[float, float]:
        """Correct by a new sighting, with the arguments of the first.

        Returns:
            What to add to the trim and to the scale of the lock.
        """
        dx, dy = self.x - sample.x, self.y - sample.y
        self._drift(sample, dx, dy)
        self._sample = sample
        range_ = max(math.hypot(dx, dy), 1e-3)
        cos, sin = dx / range_, dy / range_
        along, across, deviation = _deviations(range_)
        ex, ey, eh = x - self.x, y - self.y, wrap(heading - self.heading)
        seen = (
            ((cos, sin, 0.0), cos * ex + sin * ey, along),
            ((-sin, cos, 0.0), cos * ey - sin * ex, across),
            ((0.0, 0.0, 1.0), eh, deviation),
        )
        if not self._fits(seen):
            self._misfits += 1
            if self._misfits >= _ANEW:
                self.begin(x, y, heading, sample)
            return 0.0, 0.0
        self._misfits = 0
        state = [0.0] * 5
        for direction, error, sigma in seen:
            self._correct(state, direction, error, sigma * sigma)
        self.x += state[0]
        self.y += state[1]
        self.heading += state[2]
        return state[3], state[4]

    def _drift(self, now: OdometrySample, dx: float, dy: float) -> None:
        """A wrong trim and a wrong lock turn the gate about the car; the rest of dead reckoning's faults wander."""
        before = self._sample
        driven, turned = now.arc_length - before.arc_length, now.heading_change - before.heading_change
        p = self._covariance
        for fault, turn in ((3, CURVATURE_PER_STEERING * driven), (4, -turned)):
            fx, fy = -turn * dy, turn * dx
            for row in p:  # P F'
                row[0] += fx * row[fault]
                row[1] += fy * row[fault]
                row[2] += turn * row[fault]
            last = p[fault]
            for row, f in zip(p, (fx, fy, turn), strict=False):  # F P
                for column in range(5):
                    row[column] += f * last[column]
        # A wandering heading turns the gate about the car, too.
        wander = now.heading_noise(before)
        place = _PLACE_WALK**2 * abs(driven)
        p[0][0] += wander * dy * dy + place
        p[0][1] -= wander * dx * dy
        p[1][0] -= wander * dx * dy
        p[1][1] += wander * dx * dx + place
        p[0][2] -= wander * dy
        p[2][0] -= wander * dy
        p[1][2] += wander * dx
        p[2][1] += wander * dx
        p[2][2] += wander
        p[3][3] += now.trim_noise(before)

    def _fits(self, seen: tuple[tuple[tuple[float, float, float], float, float], ...]) -> bool:
        """Whether no part of a sighting is farther off than chance has it."""
        p = self._covariance
        for (a, b, c), error, sigma in seen:
            spread = (
                a * a * p[0][0] + b * b * p[1][1] + c * c * p[2][2]
                + 2.0 * (a * b * p[0][1] + a * c * p[0][2] + b * c * p[1][2])
            )  # fmt: skip
            if error * error > _GATE_SIGMA**2 * (spread + sigma * sigma):
                return False
        return True

    def _correct(
        self, state: list[float], direction: tuple[float, float, float], error: float, variance: float
    ) -> None:
        """Kalman's step for one number that was measured along a direction."""
        a, b, c = direction
        p = self._covariance
        ph = [a * row[0] + b * row[1] + c * row[2] for row in p]
        innovation = error - (a * state[0] + b * state[1] + c * state[2])
        spread = a * ph[0] + b * ph[1] + c * ph[2] + variance
        for i, with_it in enumerate(ph):
            state[i] += with_it / spread * innovation
        learn(p, ph, spread)

    def beside(self, x: float, y: float) -> bool:
        """Whether a car at x, y [m] of dead reckoning is so near that its side ultrasonics may hear the posts."""
        dx, dy = self.x - x, self.y - y
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return -_POSTS[1] < cos * dx + sin * dy < _POSTS[0] and abs(cos * dy - sin * dx) < _POSTS_ASIDE

    @property
    def covariance(self) -> tuple[tuple[float, ...], ...]:
        """Covariance of x [m], y [m], heading [rad], trim and steering gain at the last sighting."""
        return tuple(tuple(row) for row in self._covariance)

    @property
    def deviation(self) -> tuple[float, float, float]:
        """Standard deviations of x [m], y [m], heading [rad] at the last sighting."""
        p = self._covariance
        return math.sqrt(p[0][0]), math.sqrt(p[1][1]), math.sqrt(p[2][2])


def _deviations(range_: float) -> tuple[float, float, float]:
    """Of a sighting: along and across the line of sight [m], and of the heading [rad]."""
    return (
        _ALONG[0] + _ALONG[1] * range_,
        _ACROSS[0] + _ACROSS[1] * range_,
        _HEADING[0] + _HEADING[1] * range_ * range_,
    )
