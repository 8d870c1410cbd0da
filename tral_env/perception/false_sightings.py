"""Markers that the detector sees where there are none: windows, lamps and textures that look like a code."""

from __future__ import annotations

import math

import numpy as np

from tral_env.arrays import Index
from tral_env.config import CameraConfig, CarConfig
from tral_env.interface import MARKER_IDS, NOTHING_SEEN_ID
from tral_env.perception.gate import Detection

LIKELY_ID = 17
"""A dark frame around a bright pane is read as this id. Source: benchmarks/false_sightings.py."""
_LIKELY_SHARE = 0.8
"""Share of false markers with that id. Source: benchmarks/false_sightings.py. The others have any id that a course may
have. Source: choice, since ids of no course harm no policy."""
_RANGE_M = (0.5, 5.0)
"""Distances from the camera, m. Source: choice, where markers are seen."""
_MAX_ANGLE = 0.6
"""Largest angle between a face and the line of sight, rad. Source: choice."""
_STREAM = 1
"""Keeps the random numbers apart from the noise in the images, which has the same seed."""


class FalseSightings:
    """Puts false markers into what the cameras of n cars show.

    Each stands in one image alone, anywhere in the view, and is no part of a gate.
    """

    def __init__(self, n: int, lens: CameraConfig, car: CarConfig) -> None:
        """Begin without false markers.

        Args:
            n: number of cars.
            lens: its focal length and width tell how far aside a marker may be.
            car: where the camera sits.
        """
        self._rate = np.zeros(n)
        self._images_left = np.full(n, np.inf)
        """Images until the next false one."""
        self._rngs = [np.random.default_rng(0) for _ in range(n)]
        self._max_bearing = math.atan(lens.width / 2.0 / lens.fx)
        self._camera_x = car.camera_x

    def reset(self, row: int, rate: float, seed: int) -> None:
        """Begin an episode of a car.

        Args:
            row: which car.
            rate: share of its images with a false marker.
            seed: of the noise in its images.
        """
        self._rngs[row] = np.random.default_rng([seed, _STREAM])
        self._rate[row] = rate
        self._wait(row)

    def _wait(self, row: int) -> None:
        """Draw how many images are true until the next false one."""
        rate = float(self._rate[row])
        self._images_left[row] = self._rngs[row].geometric(rate) if rate > 0.0 else math.inf

    def add(self, rows: Index, seen: Detection) -> None:
        """Write false markers into what images show.

        Args:
            rows: (k,) cars that have exposed one.
            seen: what the images show, arrays of (k,), changed in place; a false marker replaces a true one that is
                farther away.
        """
        left = self._images_left[rows] - 1.0
        self._images_left[rows] = left
        for i in np.flatnonzero(left <= 0.0):
            row = int(rows[i])
            number, x, y, heading = self._marker(self._rngs[row])
            nearest = math.hypot(float(seen.marker_x[i]), float(seen.marker_y[i]))
            if seen.marker_id[i] == NOTHING_SEEN_ID or math.hypot(x, y) < nearest:
                seen.marker_id[i], seen.marker_x[i], seen.marker_y[i], seen.marker_heading[i] = number, x, y, heading
            self._wait(row)

    def _marker(self, rng: np.random.Generator) -> tuple[int, float, float, float]:
        """Id, x, y [m] and heading [rad] of a false marker."""
        number = LIKELY_ID if rng.random() < _LIKELY_SHARE else MARKER_IDS[rng.integers(len(MARKER_IDS))]
        range_m, bearing = rng.uniform(*_RANGE_M), rng.uniform(-self._max_bearing, self._max_bearing)
        heading = bearing + rng.uniform(-_MAX_ANGLE, _MAX_ANGLE)
        return number, self._camera_x + range_m * math.cos(bearing), range_m * math.sin(bearing), heading
