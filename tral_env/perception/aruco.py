"""ArUco markers in an image, and where they stand."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.config import CameraConfig, CarConfig
from tral_env.errors import ConfigError

Array = NDArray[np.float64]

DICTIONARY = cv2.aruco.DICT_4X4_50


@dataclass(frozen=True)
class Detections:
    """Markers found in one image."""

    ids: NDArray[np.int64]
    """(m,)"""
    corners: Array
    """(m, 4, 2) px: upper left, upper right, lower right, lower left corner of the black square, as printed."""


@dataclass(frozen=True)
class MarkerPoses:
    """Where the markers of one image stand, in the car's frame."""

    ids: NDArray[np.int64]
    """(m,)"""
    x: Array
    """(m,) m forward of the rear axle."""
    y: Array
    """(m,) m left."""
    heading: Array
    """(m,) rad, direction into the marker: 0 = the car points straight at its face."""
    error_px: Array
    """(m,) RMS distance between the corners seen and the corners of the pose."""


class Detector:
    """Finds the markers of DICT_4X4_50, corners refined to fractions of a pixel."""

    def __init__(self) -> None:
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        self._detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(DICTIONARY), parameters)

    def detect(self, image: NDArray[np.uint8]) -> Detections:
        """Markers in an image.

        Args:
            image: (h, w) grey or (h, w, 3) RGB.

        Raises:
            ConfigError: neither of these.
        """
        if image.ndim == 3 and image.shape[2] == 3:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
        if image.ndim != 2 or image.dtype != np.uint8:
            raise ConfigError(f"image of shape {image.shape}, {image.dtype}. Allowed: (h, w) or (h, w, 3), uint8")
        corners, ids, _ = self._detector.detectMarkers(image)
        if ids is None or not len(ids):
            return Detections(np.zeros(0, np.int64), np.zeros((0, 4, 2)))
        return Detections(np.ravel(ids).astype(np.int64), np.array(corners, np.float64).reshape(-1, 4, 2))


def marker_poses(detections: Detections, camera: CameraConfig, car: CarConfig | None = None) -> MarkerPoses:
    """Place each marker in the car's frame.

    The estimator takes the camera as mounted exactly: level, looking along x. Method: infinitesimal plane-based pose
    estimation (Collins and Bartoli 2014), which gives two poses for a square; markers stand upright, which tells
    them apart where the image hardly does.

    Args:
        detections: m markers.
        camera: lens and marker size.
        car: where the camera sits.
    """
    car = car or CarConfig()
    rows = [_pose(corners, camera) for corners in detections.corners]
    x, y, heading, error = np.array(rows, np.float64).reshape(-1, 4).T
    return MarkerPoses(detections.ids, x + car.camera_x, y, heading, error)


def _pose(corners: Array, camera: CameraConfig) -> tuple[float, float, float, float]:
    """Position forward and left of the camera, heading into the marker and reprojection error."""
    half = camera.marker_size / 2
    square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    _, turns, shifts, errors = cv2.solvePnPGeneric(
        square, corners, matrix, np.array(camera.distortion), flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    errors = np.ravel(errors)
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    best = int(np.argmin(errors + TILT_PX * np.abs(normals[:, 1])))
    right, _, ahead = np.ravel(shifts[best])
    # The normal looks back at the camera; camera axes are x right, y down, z forward.
    heading = np.arctan2(normals[best, 0], -normals[best, 2])
    return float(ahead), float(-right), float(heading), float(errors[best])


TILT_PX = 1.0
"""A pose leaning by an angle a counts as worse by sin(a) times this, px: a marker stands upright."""
