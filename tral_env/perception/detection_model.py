"""What the rendered detector finds and how wrong it is, as the projected camera imitates it: fitted figures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tral_env.perception.gate import DICTIONARY_SIZE

Array = NDArray[np.float64]
Figures = tuple[float, ...]
"""One figure at each level of `DetectionModel.levels`."""


@dataclass(frozen=True, kw_only=True)
class DetectionModel:
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
    half_found_px: Figures = (7.6, 8.0, 9.1, 10.9, 17.5)
    """Markers whose shortest side has this many pixels are found half of the time."""
    found_slope: Figures = (0.6, 0.62, 0.55, 0.45, 0.52)
    """Steepness of that limit, 1/px."""
    code_share: Figures = (0.15, 0.15, 0.25, 0.36, 0.4)
    """By what share that limit rises for a code whose weakness is 1."""
    weakness: Figures = (
        1.0, -0.2, 0.0, -0.3, 0.0, -0.1, 0.2, 0.1, 0.1, 0.6, -0.4,
        0.5, 0.6, -1.0, 0.7, 0.1, 0.0, -0.6, -0.2, 0.3, 0.2, -0.4,
        -0.4, -0.3, -0.2, -0.2, -0.1, 0.7, 0.8, -0.6, -0.3, 0.2, 0.1,
        -0.2, 0.0, 0.9, 0.1, -1.4, -0.4, 0.8, -0.1, -0.1, -0.6,
    )  # fmt: skip
    """Of the ids 0 to 42: codes whose cells blur into each other sooner than most, or later (below 0)."""
    sharp_px: float = 26.0
    """Corners of larger markers (root of their area in the image) are found better: the errors below shrink as
    1 / area,"""
    sharp_share: float = 0.25
    """down to this share,"""
    size_share: Figures = (0.25, 0.25, 0.28, 0.33, 0.45)
    """and that of the apparent size down to this one."""
    size_bias_px: Figures = (0.09, 0.11, 0.18, 0.31, 0.69)
    """By how much blur makes markers look smaller, hence farther."""
    size_noise_px: Figures = (0.18, 0.18, 0.225, 0.31, 0.52)
    """Standard deviation of the apparent size, from which the distance is estimated."""
    bearing_noise_px: Figures = (0.125, 0.126, 0.153, 0.207, 0.34)
    """Standard deviation across the line of sight."""
    heading_noise_px: Figures = (0.42, 0.43, 0.5, 0.66, 1.1)
    """Standard deviation of the apparent width, from which the heading is estimated."""
    perspective_gain: Figures = (2.7, 2.0, 1.75, 1.75, 1.25)
    """How much the nearer edge looking larger than the farther one helps the heading of a marker seen head-on."""
    flip_px: Figures = (0.32, 0.32, 0.44, 0.63, 1.2)
    """When the edges' difference drowns in this noise, the heading is mirrored at the line of sight."""

    def at(self, figures: Figures, degradation: Array) -> Array:
        """A figure at levels of degradation (c,)."""
        return np.interp(degradation, self.levels, figures)

    def found(self, size: Array, ids: NDArray[np.int64], degradation: Array) -> Array:
        """Probability that markers are found.

        Args:
            size: (c,) shortest sides, px.
            ids: (c,) in [0, 50).
            degradation: (c,) levels.
        """
        weak = self._weakness[ids] * self.at(self.code_share, degradation)
        half = self.at(self.half_found_px, degradation) * (1.0 + weak)
        return self.always_found / (1.0 + np.exp(-self.at(self.found_slope, degradation) * (size - half)))

    @cached_property
    def _weakness(self) -> Array:
        """(50,) of all ids; nothing is known of those that no course has."""
        return np.pad(self.weakness, (0, DICTIONARY_SIZE - len(self.weakness)))

    def softness(self, extent: Array, share: float | Array) -> Array:
        """Part of the errors that markers have whose images have these areas, as roots (c,), px.

        Args:
            extent: (c,).
            share: what is left for large markers; number or (c,).
        """
        ratio = self.sharp_px / extent
        return np.clip(ratio * ratio, share, 1.0)


DETECTION_MODEL = DetectionModel()
