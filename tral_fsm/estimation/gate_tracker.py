"""A gate kept in the frame of dead reckoning, and what its detections say about the car's own steering.

A car whose wheels stand a degree off turns by 4 degrees a metre without knowing; then in the frame of dead reckoning
the gate seems to turn about the car. The camera tells a bearing to a tenth of a degree, so half a metre of approach is
enough to learn the trim, and a gate that has left the image is still known well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tral_env.se2 import rotate_back, wrap
from tral_fsm.estimation import kalman
from tral_fsm.estimation.kalman import Matrix, Row
from tral_fsm.estimation.odometry import CURVATURE_PER_STEERING, GAIN_SIGMA, TRIM_SIGMA, OdometrySample

_PLACE_WALK = 0.02
"""How far dead reckoning's place wanders in a metre, m."""
_ALONG_SIGMA = (0.01, 0.015)
_ACROSS_SIGMA = (0.006, 0.003)
_HEADING_SIGMA = (0.01, 0.002)
"""Standard deviation of a detection, m and rad: at no distance, and what each metre (for the heading: its square) adds.
Source: the tables of docs/perception.md, with room for what the image's faults add."""
_GATE_SIGMAS = 4.0
"""A detection that is off by more standard deviations is not believed."""
_ANEW = 3
"""So many detections that are not believed, one after the other, begin the gate anew."""

_POSTS, _POSTS_ASIDE = (0.8, 0.4), 1.5
"""Posts are heard from so far before the gate to so far behind it, on a way that leads so near to its middle, m."""

_X, _Y, _HEADING, _TRIM, _GAIN = range(5)
"""Places of the unknowns in x."""


class GateTracker:
    """One gate, kept by an extended Kalman filter.

    Its unknowns x are errors: of the gate's place (x, y), of the heading of its axis, of the trim and of the steering
    gain. The gate is at (dx, dy) from the car. Over a way s on which the wheels turned the car by q, with c the
    curvature of a unit of steering, a wrong trim and a wrong gain turn the gate about the car by c s trim - q gain. The
    car's heading wanders by a variance h, which turns the gate in the same way, and its place by a variance p:

            | 1  0  0  -c s dy   q dy |          | h dy dy + p   -h dx dy      -h dy   0           0 |
            | 0  1  0   c s dx  -q dx |          | -h dx dy      h dx dx + p    h dx   0           0 |
        F = | 0  0  1   c s     -q    |      Q = | -h dy         h dx           h      0           0 |
            | 0  0  0   1        0    |          | 0             0              0      trim noise  0 |
            | 0  0  0   0        1    |          | 0             0              0      0           0 |

    F takes c at straight ahead, a gain of 1, and the lever (dx, dy) at the end of the way. A detection measures place
    and heading along and across the line of sight, whose direction is (cos, sin), each with a doubt that grows with the
    distance:

            |  cos  sin  0  0  0 |
        H = | -sin  cos  0  0  0 |           R = diag(along, across, heading)
            |  0    0    1  0  0 |
    """

    __slots__ = ("P", "_misfits", "_sample", "_trim_sigma", "heading", "opening", "x", "y")

    def __init__(
        self, x: float, y: float, heading: float, sample: OdometrySample, trim_sigma: float = TRIM_SIGMA
    ) -> None:
        """Begin with a detection.

        Args:
            x: of the gate's middle in dead reckoning, m.
            y: likewise.
            heading: of its axis, rad.
            sample: where it was seen from.
            trim_sigma: standard deviation of the trim.
        """
        self.opening = math.nan
        """Between its boards, m; NaN: not known yet."""
        self._trim_sigma = trim_sigma
        self.begin(x, y, heading, sample)

    def begin(self, x: float, y: float, heading: float, sample: OdometrySample) -> None:
        """Forget all but this detection."""
        self.x, self.y, self.heading = x, y, heading
        self._sample = sample
        self._misfits = 0
        ((cos, sin, *_), *_), (along, across, turned) = _look(x - sample.x, y - sample.y)
        shared = (along - across) * cos * sin
        self.P: Matrix = (
            (along * cos * cos + across * sin * sin, shared, 0.0, 0.0, 0.0),
            (shared, along * sin * sin + across * cos * cos, 0.0, 0.0, 0.0),
            (0.0, 0.0, turned, 0.0, 0.0),
            (0.0, 0.0, 0.0, self._trim_sigma * self._trim_sigma, 0.0),
            (0.0, 0.0, 0.0, 0.0, GAIN_SIGMA * GAIN_SIGMA),
        )
        """Covariance of x [m], y [m], heading [rad], trim and steering gain at the last detection: at the first one
        H' R H for the gate."""

    def update(self, x: float, y: float, heading: float, sample: OdometrySample) -> tuple[float, float]:
        """Correct by a new detection, with the arguments of the first.

        Returns:
            What to add to the trim and to the steering gain.
        """
        dx, dy = self.x - sample.x, self.y - sample.y
        self._predict(sample, dx, dy)
        H, R = _look(dx, dy)
        error = x - self.x, y - self.y, wrap(heading - self.heading), 0.0, 0.0
        innovations = [kalman.dot(h, error) for h in H]
        if not self._accepts(innovations, H, R):
            self._misfits += 1
            if self._misfits >= _ANEW:
                self.begin(x, y, heading, sample)
            return 0.0, 0.0
        self._misfits = 0
        (x_error, y_error, heading_error, trim, gain), self.P = kalman.update_each(self.P, innovations, H, R)
        self.x += x_error
        self.y += y_error
        self.heading += heading_error
        return trim, gain

    def _accepts(self, innovations: Sequence[float], H: Sequence[Row], R: Sequence[float]) -> bool:
        """Whether each innovation is one of few standard deviations."""
        for y, h, r in zip(innovations, H, R, strict=True):
            _, S = kalman.innovation(self.P, h, r)
            if not kalman.gate_accepts(y, S, _GATE_SIGMAS):
                return False
        return True

    def _predict(self, sample: OdometrySample, dx: float, dy: float) -> None:
        """Let the doubt grow with the way to a sample, from which the gate is at (dx, dy) [m]."""
        before, self._sample = self._sample, sample
        s, q = sample.arc_length - before.arc_length, sample.heading_change - before.heading_change
        cs, h, p = CURVATURE_PER_STEERING * s, sample.heading_noise(before), _PLACE_WALK**2 * abs(s)
        F = (
            (_X, _TRIM, -cs * dy), (_X, _GAIN, q * dy),
            (_Y, _TRIM, cs * dx), (_Y, _GAIN, -q * dx),
            (_HEADING, _TRIM, cs), (_HEADING, _GAIN, -q),
        )  # fmt: skip
        Q = (
            (_X, _X, h * dy * dy + p), (_X, _Y, -h * dx * dy), (_X, _HEADING, -h * dy),
            (_Y, _Y, h * dx * dx + p), (_Y, _HEADING, h * dx),
            (_HEADING, _HEADING, h), (_TRIM, _TRIM, sample.trim_noise(before)),
        )  # fmt: skip
        self.P = kalman.predict(self.P, F, Q)

    def beside(self, x: float, y: float) -> bool:
        """Whether a car at x, y [m] of dead reckoning is so near that its side ultrasonics may hear the posts."""
        along, left = rotate_back(math.cos(self.heading), math.sin(self.heading), self.x - x, self.y - y)
        return -_POSTS[1] < along < _POSTS[0] and abs(left) < _POSTS_ASIDE


def _look(dx: float, dy: float) -> tuple[tuple[Row, Row, Row], tuple[float, float, float]]:
    """H, and the diagonal of R, of a detection of a gate at (dx, dy) [m] from the car."""
    range_ = max(math.hypot(dx, dy), 1e-3)
    cos, sin = dx / range_, dy / range_
    H = (cos, sin, 0.0, 0.0, 0.0), (-sin, cos, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0, 0.0)
    along = _ALONG_SIGMA[0] + _ALONG_SIGMA[1] * range_
    across = _ACROSS_SIGMA[0] + _ACROSS_SIGMA[1] * range_
    turned = _HEADING_SIGMA[0] + _HEADING_SIGMA[1] * range_ * range_
    return H, (along * along, across * across, turned * turned)
