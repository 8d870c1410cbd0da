"""Find ArUco markers in an image, and tell where they stand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.config import CameraConfig, CarConfig
from tral_env.errors import ConfigError
from tral_env.perception.dictionaries import dictionary, families, marker_count
from tral_env.perception.rays import cross, lens_arrays, pixel_rays

DICTIONARY = "DICT_4X4_50"
"""The markers of gates and signs come from this dictionary."""

CORNER_INSET_PX = 0.18
"""Sub-pixel refinement finds the corners of a square this much too far inside, px, which made distances 2 % too long at
5 m. Measured: benchmarks/marker_accuracy.py."""
TILT_PX = 1.0
"""A pose that leans by an angle a counts as worse by sin(a) times this, px: a marker stands upright."""

_DOWN = np.array([0.0, 1.0, 0.0])
"""The y axis of a camera."""


@dataclass(frozen=True, eq=False)
class MarkerCorners:
    """Markers found in one image."""

    ids: NDArray[np.int64]
    """(m,) ids of the markers."""
    corners: Array
    """(m, 4, 2) px: upper left, upper right, lower right, lower left corner of the black square, as printed."""


@dataclass(frozen=True, eq=False)
class MarkerPoses:
    """Where the markers of one image stand, in the car's frame."""

    ids: NDArray[np.int64]
    """(m,) ids of the markers."""
    x: Array
    """(m,) m forward of the rear axle."""
    y: Array
    """(m,) m left."""
    heading: Array
    """(m,) rad, direction into the marker: 0 = the car points straight at its face."""
    error_px: Array
    """(m,) RMS distance between the corners seen and the corners of the pose."""


class Detector:
    """Finds the markers of a dictionary, corners refined to fractions of a pixel."""

    def __init__(self, valid_bit_threshold: float = 0.49, name: str = DICTIONARY) -> None:
        """Take the detector of OpenCV.

        Args:
            valid_bit_threshold: share of a cell's pixels that may have the wrong colour, `validBitIdThreshold` of
                OpenCV, whose default stays: a stricter one misses real markers, benchmarks/false_sightings.py.
            name: a dictionary of OpenCV; gates and signs have `DICTIONARY`.
        """
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        parameters.validBitIdThreshold = valid_bit_threshold
        self._detector = cv2.aruco.ArucoDetector(dictionary(name), parameters)

    def detect(self, image: NDArray[np.uint8]) -> MarkerCorners:
        """Find the markers in an image.

        Args:
            image: (h, w) grey or (h, w, 3) RGB, uint8.

        Raises:
            ConfigError: the image is neither of these, or has no pixels.
        """
        image = np.asarray(image)
        if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)) or not image.size:
            raise ConfigError(f"image of shape {image.shape}, {image.dtype}. Allowed: (h, w) or (h, w, 3), uint8")
        if image.ndim == 3:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
        corners, ids, _ = self._detector.detectMarkers(image)
        if ids is None or not len(ids):
            return MarkerCorners(np.zeros(0, np.int64), np.zeros((0, 4, 2)))
        found = np.array(corners, np.float64).reshape(-1, 4, 2)
        outward = found - found.mean(axis=1, keepdims=True)
        found += CORNER_INSET_PX * outward / np.linalg.norm(outward, axis=2, keepdims=True)
        return MarkerCorners(np.ravel(ids).astype(np.int64), found)


def fitting_dictionaries(image: NDArray[np.uint8], least: int = 1) -> dict[str, int]:
    """Number of markers of each family of dictionaries in an image, most first.

    A family is told by its smallest dictionary that has all ids seen.

    Args:
        image: (h, w) grey or (h, w, 3) RGB, uint8.
        least: families with fewer markers are left out.
    """
    counts = {}
    for family in families():
        ids = Detector(name=family[-1]).detect(image).ids
        if len(ids) >= least:
            counts[next(name for name in family if ids.max() < marker_count(name))] = len(ids)
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def marker_poses(detections: MarkerCorners, camera: CameraConfig, car: CarConfig | None = None) -> MarkerPoses:
    """Place each marker in the car's frame.

    The camera counts as mounted exactly: level, looking along x. Two poses follow from the homography of the square;
    both are refined to the least reprojection error, and the better one counts, where leaning counts against a pose
    because markers stand upright. OpenCV 5.0 offers the first step as SOLVEPNP_IPPE_SQUARE, but one of its two
    rotations often comes out wrong.
    Source: T. Collins and A. Bartoli, "Infinitesimal plane-based pose estimation", IJCV 109, 2014.

    Args:
        detections: m markers.
        camera: lens and size of the markers.
        car: where the camera sits.
    """
    car = car or CarConfig()
    rows = [_pose(corners, camera) for corners in detections.corners]
    x, y, heading, error = np.array(rows, np.float64).reshape(-1, 4).T
    return MarkerPoses(detections.ids, x + car.camera_x, y, heading, error)


def _pose(corners: Array, camera: CameraConfig) -> tuple[float, float, float, float]:
    """Position forward and left of the camera, m, heading into the marker, rad, and reprojection error, px."""
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
    """The first two columns, as OpenCV wants them."""
    return np.ascontiguousarray(points[:, :2], np.float32)


def _two_poses(homography: Array) -> tuple[Array, Array, Array]:
    """Two rotations and the translation of a plane whose points (x, y, 1) near (0, 0) a homography sends to rays.

    The homography maps a point (x, y) of the plane to the ray (u, v, 1): the middle (0, 0) to m, with the 2 x 2
    derivative J. Let V hold the axes of the line of sight (right, down, ahead) in the camera's frame, V Q be the
    plane's rotation, and 1 / s the depth of its middle. Projection says ``J = s [I | -m] V Q[:, :2] = s B Q[:2, :2]``:
    the first two columns of ``[I | -m] V`` are B, the third, along the line of sight, is 0. So ``s Q[:2, :2] =
    B^-1 J``, and s is its largest singular value, since a tilted plane keeps its full length along one direction. The
    third row of Q's columns follows from their unit length and right angle but for one common sign.
    """
    middle = homography[:2, 2] / homography[2, 2]
    slope = (homography[:2, :2] - np.outer(middle, homography[2, :2])) / homography[2, 2]
    ray = np.array([*middle, 1.0])
    ahead = ray / np.linalg.norm(ray)
    right = cross(_DOWN, ahead)
    right = right / np.linalg.norm(right)
    along_sight = np.stack([right, cross(ahead, right), ahead], axis=1)
    moved = (np.array([[1.0, 0.0, -middle[0]], [0.0, 1.0, -middle[1]]]) @ along_sight)[:, :2]
    part = np.linalg.solve(moved, slope)
    scale = float(np.linalg.norm(part, 2))
    part = part / scale
    rest = np.sqrt(np.maximum(1.0 - np.sum(part * part, axis=0), 0.0))
    rest[1] *= -1.0 if part[:, 0] @ part[:, 1] > 0.0 else 1.0
    turns = []
    for sign in (1.0, -1.0):
        first, second = np.vstack([part, sign * rest]).T
        turns.append(along_sight @ np.stack([first, second, cross(first, second)], axis=1))
    return turns[0], turns[1], ray / scale


def _refined(
    square: Array, corners: Array, lens: tuple[Array, Array], turn: Array, shift: Array
) -> tuple[float, float, Array, Array]:
    """Refine a pose (Levenberg-Marquardt); give its badness, RMS reprojection error, px, normal and position, m."""
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
