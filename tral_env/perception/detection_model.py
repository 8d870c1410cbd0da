"""What the detector finds in rendered images, and how wrong it is: fitted numbers that the projected camera uses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.interface import DICTIONARY_SIZE

Figures = tuple[float, ...]
"""One figure at each level of `DetectionModel.levels`."""


@dataclass(frozen=True, kw_only=True)
class DetectionModel:
    """What the detector sees in rendered images and how well: fitted numbers, in pixels so that they hold for any lens.
    One is a share of the image, because it is one in OpenCV.

    A number that depends on the level of image degradation (`tral_env.perception.degrade`) has a figure at each of
    `levels`; between them it is interpolated, beyond the last it stays. Source: benchmarks/detector_fit.py.
    """

    levels: Figures = (0.0, 1.0, 1.5, 2.0, 3.0)
    """Levels of image degradation."""
    margin_px: float = 3.0
    """The detector loses a marker with a corner nearer to the image's edge than this."""
    always_found: float = 0.993
    """The detector finds this share of large markers."""
    min_side_share: float = 0.03 / 4
    """The detector finds no marker whose shortest side is a smaller share of the image's longer side: 4.8 px of 640.
    Source: OpenCV drops outlines shorter than `minMarkerPerimeterRate`, 0.03, of the longer side."""
    half_found_px: Figures = (7.6, 8.0, 9.1, 10.9, 17.5)
    """The detector finds half of the markers whose shortest side has this many pixels."""
    found_slope: Figures = (0.6, 0.62, 0.55, 0.45, 0.52)
    """The share found grows around `half_found_px` with this steepness, 1/px."""
    code_share: Figures = (0.15, 0.15, 0.25, 0.36, 0.4)
    """For a code whose weakness is 1, `half_found_px` rises by this share."""
    weakness: Figures = (
        1.0, -0.2, 0.0, -0.3, 0.0, -0.1, 0.2, 0.1, 0.1, 0.6, -0.4,
        0.5, 0.6, -1.0, 0.7, 0.1, 0.0, -0.6, -0.2, 0.3, 0.2, -0.4,
        -0.4, -0.3, -0.2, -0.2, -0.1, 0.7, 0.8, -0.6, -0.3, 0.2, 0.1,
        -0.2, 0.0, 0.9, 0.1, -1.4, -0.4, 0.8, -0.1, -0.1, -0.6,
    )  # fmt: skip
    """The code of each id, 0 to 42, blurs sooner than the mean one (above 0) or later (below 0)."""
    sharp_px: float = 26.0
    """The errors of a marker shrink with 1 / area once the root of its area in the image is above this."""
    sharp_share: float = 0.25
    """The errors of bearing and heading shrink down to this share."""
    size_share: Figures = (0.25, 0.25, 0.28, 0.33, 0.45)
    """The error of the apparent size shrinks down to this share."""
    size_bias_px: Figures = (0.09, 0.11, 0.18, 0.31, 0.69)
    """Blur makes a marker look this much smaller, hence farther."""
    size_noise_px: Figures = (0.18, 0.18, 0.225, 0.31, 0.52)
    """Standard deviation of the apparent size, which tells the distance."""
    bearing_noise_px: Figures = (0.125, 0.126, 0.153, 0.207, 0.34)
    """Standard deviation across the line of sight."""
    heading_noise_px: Figures = (0.42, 0.43, 0.5, 0.66, 1.1)
    """Standard deviation of the apparent width, which tells the heading."""
    perspective_gain: Figures = (2.7, 2.0, 1.75, 1.75, 1.25)
    """The perspective, the nearer edge larger than the farther one, tells the heading too: it counts as a sine of this
    times edge over distance."""
    flip_px: Figures = (0.32, 0.32, 0.44, 0.63, 1.2)
    """The heading is mirrored at the line of sight when noise of this deviation exceeds the difference of the edges."""

    def at(self, figures: Figures, degradation: Array) -> Array:
        """Interpolate a figure at levels of degradation, (c,) -> (c,)."""
        return np.interp(degradation, self.levels, figures)

    def found(self, size: Array, ids: NDArray[np.int64], degradation: Array, image_px: int) -> Array:
        """Probability that markers are found, (c,): ``always_found / (1 + exp(-slope (size - half)))``.

        It is 0 below `min_side_share`.

        Args:
            size: (c,) shortest sides, px.
            ids: (c,) in [0, 50).
            degradation: (c,) levels.
            image_px: longer side of the image, px.
        """
        weak = self._weakness[ids] * self.at(self.code_share, degradation)
        half = self.at(self.half_found_px, degradation) * (1.0 + weak)
        share = self.always_found / (1.0 + np.exp(-self.at(self.found_slope, degradation) * (size - half)))
        return np.where(size < self.min_side_share * image_px, 0.0, share)

    @cached_property
    def _weakness(self) -> Array:
        """Weakness of all ids, (50,); 0 for an id that no course has."""
        return np.pad(self.weakness, (0, DICTIONARY_SIZE - len(self.weakness)))

    def softness(self, extent: Array, share: float | Array) -> Array:
        """Share of the errors left for markers of a size e in the image: ``clip((sharp / e)^2, share, 1)``, (c,).

        Args:
            extent: (c,) e, root of the area in the image, px.
            share: what is left for the largest markers; number or (c,).
        """
        ratio = self.sharp_px / extent
        return np.clip(ratio * ratio, share, 1.0)


DETECTION_MODEL = DetectionModel()
"""The model as it was fitted."""
