"""ArUco markers of DICT_4X4_50 as images."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.geometry import MARKER_MODULES, MARKER_QUIET_MODULES

PIXELS_PER_MODULE = 8
"""A cell of the texture is this wide: from 0.6 to 7 m the detector reads 4, 8, 16 and 32 alike."""


def marker_image(marker: int) -> NDArray[np.uint8]:
    """Draw a marker with its quiet zone, upright, (64, 64) grey values.

    Args:
        marker: id in DICT_4X4_50.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    code = cv2.aruco.generateImageMarker(dictionary, marker, MARKER_MODULES * PIXELS_PER_MODULE)
    return np.pad(code, MARKER_QUIET_MODULES * PIXELS_PER_MODULE, constant_values=255)


def material_name(marker: int) -> str:
    """Name, in the MuJoCo model, of the material that shows a marker."""
    return f"marker_{marker:02d}"
