"""What a webcam does to an image: wrong exposure, blur, glare, noise. One level sets all four."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class WebcamLaw:
    """How much of each a level of 1 ("mild") brings; all grow with the level. Source: choice."""

    exposure: float = 0.12
    """Largest relative error of the exposure, either way."""
    blur_px: float = 0.4
    """Standard deviation of the blur, px."""
    glare: float = 14.0
    """Brightness that a lamp above adds at the image's upper edge, fading to the middle, grey levels."""
    noise: float = 2.5
    """Standard deviation of the noise, grey levels."""


def degrade(image: Image, level: float, rng: np.random.Generator, law: WebcamLaw | None = None) -> Image:
    """The image as a webcam would have taken it.

    Args:
        image: (h, w, 3) RGB.
        level: 0 leaves it as it is; 1 mild; 3 strong.
        rng: source of noise and exposure.
        law: how much of each.

    Returns:
        (h, w, 3), a new array unless the level is 0.
    """
    if level <= 0:
        return image
    law = law or WebcamLaw()
    height, width = image.shape[:2]
    out = cv2.GaussianBlur(image, (0, 0), law.blur_px * level) if law.blur_px > 0 else image
    out = cv2.convertScaleAbs(out, alpha=1 + law.exposure * level * rng.uniform(-1, 1))
    fade = np.clip(1 - 2 * np.arange(height) / height, 0, 1) * law.glare * level * rng.uniform(0, 1)
    top, left = rng.integers(_SHIFTS, size=2)
    grain = _grain(height + _SHIFTS, width + _SHIFTS)[top : top + height, left : left + width]
    added = np.rint(grain * np.float32(law.noise * level) + fade.astype(np.float32)[:, None]).astype(np.int16)
    return np.asarray(cv2.add(out, cv2.merge([added] * 3), dtype=cv2.CV_8U), np.uint8)


_SHIFTS = 64
"""The grain of an image is a window of one large grain, at one of this many places each way: drawing normal numbers
for every pixel of every image would cost more than all the rest."""


@lru_cache(maxsize=4)
def _grain(height: int, width: int) -> NDArray[np.float32]:
    return np.random.default_rng(0).standard_normal((height, width), np.float32)
