"""A gate kept in the frame of dead reckoning, and what its detections say about the car's own steering.

A car whose wheels stand a degree off turns by 4 degrees a metre without knowing; then in the frame of dead reckoning
the gate seems to turn about the car. The camera tells a bearing to a tenth of a degree, so half a metre of approach is
enough to learn the trim, and a gate that has left the image is still known well.
"""

from __future__ import annotations

import math

import numpy as np

from tral_env.se2 import wrap
from tral_fsm.estimation import kalman
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

    __slots__ = ("P", "_F", "_H", "_Q", "_R", "_misfits", "_sample", "_trim_sigma", "heading", "opening", "x", "y")

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
        self._F, self._Q, self._H, self._R = np.eye(5), np.zeros((5, 5)), np.eye(3, 5), np.zeros((3, 3))
        self.begin(x, y, heading, sample)

    def begin(self, x: float, y: float, heading: float, sample: OdometrySample) -> None:
        """Forget all but this detection."""
        self.x, self.y, self.heading = x, y, heading
        self._sample = sample
        self._misfits = 0
        self._look(x - sample.x, y - sample.y)
        self.P = self._H.T.dot(self._R).dot(self._H) + np.diag(
            (0.0, 0.0, 0.0, self._trim_sigma * self._trim_sigma, GAIN_SIGMA * GAIN_SIGMA)
        )
        """Covariance of x [m], y [m], heading [rad], trim and steering gain at the last detection, (5, 5)."""

    def update(self, x: float, y: float, heading: float, sample: OdometrySample) -> tuple[float, float]:
        """Correct by a new detection, with the arguments of the first.

        Returns:
            What to add to the trim and to the steering gain.
        """
        dx, dy = self.x - sample.x, self.y - sample.y
        self._predict(sample, dx, dy)
        cos, sin = self._look(dx, dy)
        ex, ey = x - self.x, y - self.y
        innovation = (cos * ex + sin * ey, cos * ey - sin * ex, wrap(heading - self.heading))
        PH, S = kalman.innovation_covariance(self.P, self._H, self._R)
        if not kalman.gate_accepts(innovation, S, _GATE_SIGMAS):
            self._misfits += 1
            if self._misfits >= _ANEW:
                self.begin(x, y, heading, sample)
            return 0.0, 0.0
        self._misfits = 0
        errors, self.P = kalman.update(self.P, innovation, PH, S)
        x_error, y_error, heading_error, trim, gain = errors.tolist()
        self.x += x_error
        self.y += y_error
        self.heading += heading_error
        return trim, gain

    def _predict(self, sample: OdometrySample, dx: float, dy: float) -> None:
        """Let the doubt grow with the way to a sample, from which the gate is at (dx, dy) [m]."""
        before, self._sample = self._sample, sample
        s, q = sample.arc_length - before.arc_length, sample.heading_change - before.heading_change
        cs, h, p = CURVATURE_PER_STEERING * s, sample.heading_noise(before), _PLACE_WALK**2 * abs(s)
        F, Q = self._F, self._Q
        F[_X, _TRIM], F[_Y, _TRIM], F[_HEADING, _TRIM] = -cs * dy, cs * dx, cs
        F[_X, _GAIN], F[_Y, _GAIN], F[_HEADING, _GAIN] = q * dy, -q * dx, -q
        Q[_X, _X], Q[_Y, _Y], Q[_HEADING, _HEADING] = h * dy * dy + p, h * dx * dx + p, h
        Q[_X, _Y] = Q[_Y, _X] = -h * dx * dy
        Q[_X, _HEADING] = Q[_HEADING, _X] = -h * dy
        Q[_Y, _HEADING] = Q[_HEADING, _Y] = h * dx
        Q[_TRIM, _TRIM] = sample.trim_noise(before)
        self.P = kalman.predict(self.P, F, Q)

    def _look(self, dx: float, dy: float) -> tuple[float, float]:
        """Set H and R for a gate at (dx, dy) [m] from the car; gives the line of sight (cos, sin)."""
        range_ = max(math.hypot(dx, dy), 1e-3)
        cos, sin = dx / range_, dy / range_
        H, R = self._H, self._R
        H[0, 0], H[0, 1] = cos, sin
        H[1, 0], H[1, 1] = -sin, cos
        R[0, 0] = (_ALONG_SIGMA[0] + _ALONG_SIGMA[1] * range_) ** 2
        R[1, 1] = (_ACROSS_SIGMA[0] + _ACROSS_SIGMA[1] * range_) ** 2
        R[2, 2] = (_HEADING_SIGMA[0] + _HEADING_SIGMA[1] * range_ * range_) ** 2
        return cos, sin

    def beside(self, x: float, y: float) -> bool:
        """Whether a car at x, y [m] of dead reckoning is so near that its side ultrasonics may hear the posts."""
        dx, dy = self.x - x, self.y - y
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return -_POSTS[1] < cos * dx + sin * dy < _POSTS[0] and abs(cos * dy - sin * dx) < _POSTS_ASIDE
