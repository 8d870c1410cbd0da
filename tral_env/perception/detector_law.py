"""What the rendered detector finds and how wrong it is, as the projected camera imitates it: fitted figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Figures = tuple[float, ...]
"""One figure at each level of `DetectorLaw.levels`."""


@dataclass(frozen=True, kw_only=True)
class DetectorLaw:
    """What the rendered detector sees and how well: fitted numbers, in pixels so that they hold for any lens.

    What depends on the level of image degradation (`tral_env.perception.degrade`) has a figure at each of `levels`;
    between them it is interpolated, beyond the last it stays. Source: benchmarks/detector_fit.py.
    """

    levels: Figures = (0.0, 1.0, 1.5, 2.0, 3.0)
    """Levels of image degradation."""
    margin_px: float = 3.0
    """A corner nearer to the image's edge is lost."""
    always_found: float = 0.993
    """Share of large markers that are found."""
    half_found_px: Figures = (8.6, 8.6, 10.1, 12.6, 18.3)
    """Markers whose shortest side has this many pixels are found half of the time."""
    found_slope: Figures = (0.65, 0.65, 0.6, 0.47, 0.44)
    """Steepness of that limit, 1/px."""
    sharp_px: float = 26.0
    """Corners of larger markers (root of their area in the image) are found better: the errors below shrink as
    1 / area,"""
    sharp_share: float = 0.25
    """down to this share."""
    size_bias_px: Figures = (0.1, 0.12, 0.19, 0.31, 0.72)
    """By how much blur makes markers look smaller, hence farther."""
    size_noise_px: Figures = (0.18, 0.18, 0.225, 0.31, 0.55)
    """Standard deviation of the apparent size, from which the distance is estimated."""
    bearing_noise_px: Figures = (0.126, 0.128, 0.146, 0.205, 0.35)
    """Standard deviation across the line of sight."""
    heading_noise_px: Figures = (0.46, 0.46, 0.52, 0.66, 1.2)
    """Standard deviation of the apparent width, from which the heading is estimated."""
    perspective_gain: Figures = (3.3, 2.2, 2.0, 1.9, 1.5)
    """How much the nearer edge looking larger than the farther one helps the heading of a marker seen head-on."""
    flip_px: Figures = (0.34, 0.34, 0.41, 0.67, 1.25)
    """When the edges' difference drowns in this noise, the heading is mirrored at the line of sight."""

    def at(self, figures: Figures, degradation: Array) -> Array:
        """A figure at levels of degradation (c,)."""
        return np.interp(degradation, self.levels, figures)

    def found(self, size: Array, degradation: Array) -> Array:
        """Probability that markers of these shortest sides (c,), px, are found."""
        slope, half = self.at(self.found_slope, degradation), self.at(self.half_found_px, degradation)
        return self.always_found / (1.0 + np.exp(-slope * (size - half)))

    def softness(self, extent: Array) -> Array:
        """Share of the errors that markers have whose images have these areas, as roots (c,), px."""
        ratio = self.sharp_px / extent
        return np.clip(ratio * ratio, self.sharp_share, 1.0)


LAW = DetectorLaw()
