"""From pixels to the rays of a distorting lens, to 0.0001 px, and a lens as OpenCV wants it."""

from __future__ import annotations

import cv2
import numpy as np

from tral_env.arrays import Array
from tral_env.config import CameraConfig

_UNTIL = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-8)
"""The iteration ends here: OpenCV's own five steps miss by 9 px in the corners of the wide lens, these by less than
0.0001."""


def lens_arrays(camera: CameraConfig) -> tuple[Array, Array]:
    """Camera matrix, (3, 3), and distortion, (5,), as OpenCV's functions take them."""
    matrix = np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
    return matrix, np.array(camera.distortion)


def pixel_rays(pixels: Array, camera: CameraConfig) -> Array:
    """Where the rays of pixels meet the plane one metre ahead: the inverse of the lens, which has no closed form.

    The lens bends a ray (x, y, 1) to ``d(x, y) = (x, y) (1 + k1 r^2 + k2 r^4 + k3 r^6) + tangential terms``; OpenCV
    solves it for (x, y) by the fixed point of ``(x, y) <- (distorted - tangential) / radial``.

    Args:
        pixels: (k, 2) px.
        camera: the lens.

    Returns:
        (k, 2) m to the right and down.
    """
    found = cv2.undistortPoints(np.ascontiguousarray(pixels[:, None]), *lens_arrays(camera), criteria=_UNTIL)
    return np.asarray(found, np.float64)[:, 0]


def cross(a: Array, b: Array) -> Array:
    """Cross product of two vectors (3,). For a single pair NumPy's own takes ten times as long."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])
