"""What a webcam does to an image: wrong exposure, blur, glare, noise. One level sets all four.

Two faults more are off until asked for: the streak that turning leaves, and something before the lens.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Image
from tral_env.checks import is_number
from tral_env.errors import ConfigError

_MAX_AT_LEVEL_1 = {"exposure": 1.0, "blur_px": 100.0, "glare": 255.0, "noise": 255.0, "streak_px": 1000.0, "patch": 1.0}
"""A level of 1 may bring at most this much of each fault."""
PATCH_GREYS = (20, 235)
"""A patch has one of these grey levels: as dark as a shadow, or as bright as a lamp. Source: choice."""
_SHIFTS = 64
"""The grain of an image is a window of one large grain, at one of this many places each way: normal numbers for every
pixel of every image would cost more than all the rest."""


@dataclass(frozen=True, kw_only=True)
class ImageCorruption:
    """How much of each fault a level of 1 ("mild") brings; all grow with the level. Source: choice."""

    exposure: float = 0.12
    """Largest relative error of the exposure, either way."""
    blur_px: float = 0.4
    """Standard deviation of the blur, px."""
    glare: float = 14.0
    """Brightness that a lamp above adds at the image's upper edge, fading to the middle, grey levels."""
    noise: float = 2.5
    """Standard deviation of the noise, grey levels."""
    streak_px: float = 0.0
    """Longest level streak that the image is drawn out to, px. 2 (6 at level 3): a car that turns at 1 rad/s while
    the shutter of the default lens is open for 10 ms."""
    patch: float = 0.0
    """Side of a dark or bright square somewhere in the image, as a share of the image's height."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value, most = getattr(self, field.name), _MAX_AT_LEVEL_1[field.name]
            if not is_number(value) or not 0 <= value <= most:
                raise ConfigError(f"ImageCorruption.{field.name} = {value!r}: expected a number from 0 to {most:g}")

    def scaled(self, share: float) -> ImageCorruption:
        """The corruption of the same image with this share of its pixels across.

        Fewer pixels, each the mean of many: less of the noise is left, and blur and streak are shorter.
        """
        names = ("blur_px", "noise", "streak_px")
        return replace(self, **{name: min(getattr(self, name) * share, _MAX_AT_LEVEL_1[name]) for name in names})


class DrawnFaults(NamedTuple):
    """What chance brings to one image."""

    streak: float
    """Share of the longest streak, 0 to 1."""
    light: float
    """Share of the largest error of the exposure, -1 to 1."""
    glare: float
    """Share of the most glare, 0 to 1."""
    grain: tuple[int, int]
    """Place of the image's window in the large grain, px down and right."""
    patch: tuple[int, int, int]
    """Middle of the patch, px down and right, and its grey level."""


def draw_faults(
    shape: tuple[int, int], level: float, rng: np.random.Generator, corruption: ImageCorruption | None = None
) -> DrawnFaults | None:
    """Draw the faults of an image of this height and width, px, for `with_faults`; None where the level is 0."""
    if level <= 0:
        return None
    corruption = corruption or ImageCorruption()
    streak = rng.uniform(0, 1) if corruption.streak_px > 0 else 0.0
    light, glare = rng.uniform(-1, 1), rng.uniform(0, 1)
    down, right = rng.integers(_SHIFTS, size=2).tolist()
    patch = (0, 0, 0)
    if corruption.patch > 0:
        patch = (*rng.integers(shape).tolist(), int(rng.choice(PATCH_GREYS)))
    return DrawnFaults(streak, light, glare, (down, right), patch)


def degrade(image: Image, level: float, rng: np.random.Generator, corruption: ImageCorruption | None = None) -> Image:
    """Spoil an image as a webcam does: blur, streak, exposure, glare, noise, and something before the lens.

    Args:
        image: (h, w, 3) RGB, uint8.
        level: 0 leaves the image as it is; 1 is mild, 3 strong.
        rng: source of all chance.
        corruption: how much of each fault a level of 1 brings.

    Returns:
        (h, w, 3), a new array unless the level is 0.
    """
    return with_faults(image, level, draw_faults(image.shape[:2], level, rng, corruption), corruption)


def with_faults(image: Image, level: float, drawn: DrawnFaults | None, corruption: ImageCorruption | None) -> Image:
    """As `degrade`, with chance that `draw_faults` has drawn for this level and corruption."""
    if drawn is None:
        return image
    corruption = corruption or ImageCorruption()
    height, width = image.shape[:2]
    out = image
    if (blur := corruption.blur_px * level) > 0:
        out = np.asarray(cv2.GaussianBlur(image, (0, 0), blur), np.uint8)
    if corruption.streak_px > 0:
        out = _streaked(out, corruption.streak_px * level * drawn.streak)
    light = max(1 + corruption.exposure * level * drawn.light, 0.0)
    out = np.asarray(cv2.convertScaleAbs(out, alpha=light), np.uint8)
    # From here on in place: the pages of new arrays cost as much as the arithmetic.
    fade = np.clip(1 - 2 * np.arange(height) / height, 0, 1) * corruption.glare * level * drawn.glare
    down, right = drawn.grain
    grain = _grain(height + _SHIFTS, width + _SHIFTS)[down : down + height, right : right + width]
    added = grain * np.float32(corruption.noise * level)
    added += fade.astype(np.float32)[:, None]
    levels = np.rint(added, out=added).astype(np.int16)
    cv2.add(out, cv2.merge([levels] * 3), dst=out, dtype=cv2.CV_8U)
    if corruption.patch > 0:
        _cover(out, round(min(corruption.patch * level, 1.0) * height), *drawn.patch)
    return out


def _streaked(image: Image, length: float) -> Image:
    """Draw an image out to the sides: the mean over a level stretch of this length, px; below one pixel the image."""
    if length <= 1:
        return image
    reach = int(np.ceil((length - 1) / 2))
    weights = np.clip((length + 1) / 2 - np.abs(np.arange(-reach, reach + 1)), 0, 1)
    return np.asarray(cv2.filter2D(image, -1, weights[None] / length), np.uint8)


def _cover(image: Image, side: int, down: int, right: int, grey: int) -> None:
    """Cover a square of this side about this place, px, in place."""
    first = np.maximum(np.array([down, right]) - side // 2, 0)
    last = np.maximum(np.array([down, right]) - side // 2 + side, 0)
    image[first[0] : last[0], first[1] : last[1]] = grey


@lru_cache(maxsize=4)
def _grain(height: int, width: int) -> NDArray[np.float32]:
    return np.random.default_rng(0).standard_normal((height, width), np.float32)
