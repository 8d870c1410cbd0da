"""ArUco markers in an image, and where they stand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.config import CameraConfig, CarConfig
from tral_env.errors import ConfigError
from tral_env.perception.rays import lens_arrays, pixel_rays

Array = NDArray[np.float64]

DICTIONARY = cv2.aruco.DICT_4X4_50

CORNER_INSET_PX = 0.18
"""Sub-pixel refinement finds the corners of a square this much too far inside, which made distances 2 % too long at
5 m. Measured: benchmarks/marker_accuracy.py."""


@dataclass(frozen=True)
class MarkerCorners:
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

    def __init__(self, valid_bit_threshold: float = 0.49) -> None:
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        parameters.validBitIdThreshold = valid_bit_threshold
        self._detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(DICTIONARY), parameters)

    def detect(self, image: NDArray[np.uint8]) -> MarkerCorners:
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
            return MarkerCorners(np.zeros(0, np.int64), np.zeros((0, 4, 2)))
        found = np.array(corners, np.float64).reshape(-1, 4, 2)
        outward = found - found.mean(axis=1, keepdims=True)
        found += CORNER_INSET_PX * outward / np.linalg.norm(outward, axis=2, keepdims=True)
        return MarkerCorners(np.ravel(ids).astype(np.int64), found)


def marker_poses(detections: MarkerCorners, camera: CameraConfig, car: CarConfig | None = None) -> MarkerPoses:
    """Place each marker in the car's frame.

    The estimator takes the camera as mounted exactly: level, looking along x. Method: two
    poses from the homography of the square (infinitesimal plane-based pose estimation, Collins and Bartoli 2014), both
    refined to the least reprojection error, of which the better counts; markers stand upright. OpenCV 5.0 offers this
    as SOLVEPNP_IPPE_SQUARE, but one of its two rotations often comes out wrong.

    Args:
        detections: m markers.
        camera: lens and marker size.
        car: where the camera sits.
    """
    car = car or CarConfig()
    rows = [_pose(corners, camera) for corners in detections.corners]
    x, y, heading, error = np.array(rows, np.float64).reshape(-1, 4).T
    return MarkerPoses(detections.ids, x + car.camera_x, y, heading, error)


TILT_PX = 1.0
"""A pose leaning by an angle a counts as worse by sin(a) times this, px: a marker stands upright."""


def _pose(corners: Array, camera: CameraConfig) -> tuple[float, float, float, float]:
    """Position forward and left of the camera, heading into the marker and reprojection error."""
    half = camera.marker_size / 2
    square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    lens = lens_arrays(camera)
    rays = pixel_rays(corners, camera)
    homography = np.asarray(cv2.getPerspectiveTransform(_flat(square), _flat(rays)), np.float64)
    *turns, shift = _two_poses(homography)
    found = [_refined(square, corners, lens, turn, shift) for turn in turns]
    # Camera axes are x right, y down, z forward; a marker's normal looks back at the camera.
    _, error, normal, (right, _, ahead) = min(found, key=_first)
    return float(ahead), float(-right), float(np.arctan2(normal[0], -normal[2])), error


def _flat(points: Array) -> NDArray[np.float32]:
    return np.ascontiguousarray(points[:, :2], np.float32)


def _two_poses(homography: Array) -> tuple[Array, Array, Array]:
    """Two rotations and the translation of a plane whose points (x, y, 1) near (0, 0) a homography sends to rays.

    Around the middle the homography is a 2 x 2 matrix; seen along the line of sight it is the upper left part of a
    rotation times a scale. The rest of that rotation follows but for one sign.
    """
    middle = homography[:2, 2] / homography[2, 2]
    slope = (homography[:2, :2] - np.outer(middle, homography[2, :2])) / homography[2, 2]
    ray = np.array([*middle, 1.0])
    ahead = ray / np.linalg.norm(ray)
    right = np.cross([0.0, 1.0, 0.0], ahead)
    right = right / np.linalg.norm(right)
    along_sight = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    moved = (np.array([[1.0, 0.0, -middle[0]], [0.0, 1.0, -middle[1]]]) @ along_sight)[:, :2]
    part = np.linalg.solve(moved, slope)
    scale = float(np.linalg.norm(part, 2))
    part = part / scale
    rest = np.sqrt(np.maximum(1.0 - np.sum(part * part, axis=0), 0.0))
    rest[1] *= -1.0 if part[:, 0] @ part[:, 1] > 0.0 else 1.0
    turns = []
    for sign in (1.0, -1.0):
        first, second = np.vstack([part, sign * rest]).T
        turns.append(along_sight @ np.stack([first, second, np.cross(first, second)], axis=1))
    return turns[0], turns[1], ray / scale


def _refined(
    square: Array, corners: Array, lens: tuple[Array, Array], turn: Array, shift: Array
) -> tuple[float, float, Array, Array]:
    """Badness, RMS reprojection error, normal and position of the best pose near a first one."""
    first = cv2.Rodrigues(turn)[0], shift[:, None]
    best = cv2.solvePnPRefineLM(square, corners, *lens, first[0].copy(), first[1].copy())
    # The refinement seldom, but badly, runs away from very slanted views.
    error, vector, place = min(((_error(square, corners, lens, *pose), *pose) for pose in (best, first)), key=_first)
    normal = np.asarray(cv2.Rodrigues(vector)[0][:, 2], np.float64)
    return error + TILT_PX * abs(float(normal[1])), error, normal, np.asarray(np.ravel(place), np.float64)


def _first(items: tuple[Any, ...]) -> float:
    return float(items[0])


def _error(square: Array, corners: Array, lens: tuple[Array, Array], vector: Any, place: Any) -> float:
    """RMS distance of the corners from those of a pose, px."""
    again = np.asarray(cv2.projectPoints(square, vector, place, *lens)[0], np.float64)[:, 0]
    return float(np.sqrt(np.mean(np.sum((again - corners) ** 2, axis=1))))
