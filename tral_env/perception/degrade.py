"""What a webcam does to an image: wrong exposure, blur, glare, noise. One level sets all four."""

from __future__ import annotations

from dataclasses import dataclass

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
    blurred = cv2.GaussianBlur(image, (0, 0), law.blur_px * level) if law.blur_px > 0 else image
    gain = 1 + law.exposure * level * rng.uniform(-1, 1)
    height, width = image.shape[:2]
    fade = np.clip(1 - 2 * np.arange(height) / height, 0, 1) * law.glare * level * rng.uniform(0, 1)
    bright = blurred * np.float32(gain) + fade.astype(np.float32)[:, None, None]
    grain = rng.standard_normal((height, width, 1), np.float32) * np.float32(law.noise * level)
    return np.asarray(np.clip(bright + grain, 0, 255), np.uint8)
