"""Images of markers as a lens sees them, without MuJoCo."""

from __future__ import annotations

import cv2
import numpy as np

from tral_env.config import CameraConfig
from tral_env.perception.dictionaries import dictionary, marker_modules
from tral_env.perception.rays import lens_arrays

CELL_PX = 32


def photograph(
    markers: list[tuple[int, float, float]], lens: CameraConfig | None = None, name: str = "DICT_4X4_50"
) -> np.ndarray:
    """Markers upright across the line of sight, (h, w, 3) RGB.

    Args:
        markers: id, m ahead of the camera and m left of it, of each.
        lens: without distortion.
        name: dictionary.
    """
    lens = lens or CameraConfig()
    cells = marker_modules(name)
    image = np.full((lens.height, lens.width), 90, np.uint8)
    for marker, ahead, left in markers:
        code = cv2.aruco.generateImageMarker(dictionary(name), marker, cells * CELL_PX)
        plate = np.pad(code, CELL_PX, constant_values=255)
        half = lens.marker_size / 2 * (cells + 2) / cells
        square = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
        place = np.array([-left, 0.0, ahead])
        ends = cv2.projectPoints(square, np.zeros(3), place, *lens_arrays(lens))[0][:, 0]
        width = len(plate)
        starts = np.array([[0, 0], [width, 0], [width, width], [0, width]], np.float32) - 0.5
        turn = cv2.getPerspectiveTransform(starts, ends.astype(np.float32))
        size = lens.width, lens.height
        # Four rays across and down in each pixel keep edges sharp but not jagged.
        finer = np.array([[4, 0, 1.5], [0, 4, 1.5], [0, 0, 1]])
        large = size[0] * 4, size[1] * 4
        drawn = cv2.resize(cv2.warpPerspective(plate, finer @ turn, large), size, interpolation=cv2.INTER_AREA)
        mask = cv2.warpPerspective(np.full_like(plate, 255), finer @ turn, large)
        share = cv2.resize(mask, size, interpolation=cv2.INTER_AREA) / 255
        image = np.rint(image * (1 - share) + drawn).clip(0, 255).astype(np.uint8)
    return np.repeat(image[..., None], 3, axis=2)
