"""Seeded poses of a calibration board before a camera, as a good calibration needs them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tral_env.arrays import Array
from tral_env.calibration.boards import Board
from tral_env.config import CameraConfig
from tral_env.perception.rays import lens_arrays, pixel_rays

TILT_DEG = 45.0
"""The board's normal leaves the line of sight by at most this angle."""
ROLL_DEG = 40.0
"""The board is turned about the line of sight by at most this angle either way."""
WIDTH_SHARES = (0.3, 0.8)
"""The board is as wide as this share of the image, from the farthest pose to the nearest."""
ATTEMPTS = 10
"""A pose that leaves the image is brought nearer to the middle so often, the last time onto it."""


@dataclass(frozen=True, eq=False)
class BoardPose:
    """Where a board is, in the camera's frame: x right, y down, z forward."""

    rotation: Array
    """(3, 3) its axes, in columns."""
    middle: Array
    """(3,) its middle, m."""

    def place(self, board: Board, points: Array) -> Array:
        """Points of the board, (k, 3) m in its own frame, seen from the camera."""
        return (points - [board.size[0] / 2, board.size[1] / 2, 0.0]) @ self.rotation.T + self.middle


def seeded_poses(board: Board, lens: CameraConfig, count: int, seed: int) -> list[BoardPose]:
    """Draw poses all over the image, near and far, tilted to all sides.

    A Latin hypercube spreads each of the six numbers of a pose evenly over its range: number i of `count` poses takes
    every one of `count` equal parts of the range once, in an order drawn on its own.
    A ChArUco board may leave the image with four tenths of its corners, a chessboard not at all.

    Args:
        board: the board.
        lens: the lens of the camera.
        count: number of poses.
        seed: the same seed gives the same poses.
    """
    rng = np.random.default_rng(seed)
    spread = (np.array([rng.permutation(count) for _ in range(6)]) + rng.uniform(size=(6, count))) / count
    return [_pose(board, lens, *(float(value) for value in values)) for values in spread.T]


def _pose(
    board: Board, lens: CameraConfig, u: float, v: float, nearness: float, tilt: float, side: float, roll: float
) -> BoardPose:
    """A pose from six numbers in [0, 1]: place in the image, nearness, tilt, the side to which it tilts, roll.

    A board of the width w that fills the share q of an image of W px stands at about ``w fx / (q W)``.
    """
    aim = np.array([lens.width * _outward(u) - lens.cx, lens.height * _outward(v) - lens.cy])
    share = WIDTH_SHARES[0] + (WIDTH_SHARES[1] - WIDTH_SHARES[0]) * nearness
    angles = np.radians([TILT_DEG * tilt, 360.0 * side, ROLL_DEG * (2 * roll - 1)])
    needed = 0.6 if board.kind == "charuco" else 1.0
    for attempt in range(ATTEMPTS):
        # Each attempt is nearer to the middle of the image, and farther from the camera.
        inward = 1.0 - attempt / (ATTEMPTS - 1)
        distance = board.size[0] * lens.fx / (share * lens.width) * (1.0 + 0.05 * attempt)
        pose = _towards(lens, aim * inward, distance, *(float(angle) for angle in angles))
        if _in_view(board, lens, pose) >= needed:
            break
    return pose


def _outward(share: float) -> float:
    """Move a place from 0 to 1 towards the nearer end, because the image's edge tells most about distortion."""
    off = 2.0 * share - 1.0
    return float(0.5 + 0.5 * np.copysign(np.sqrt(abs(off)), off))


def _towards(lens: CameraConfig, aim: Array, distance: float, tilt: float, side: float, roll: float) -> BoardPose:
    """Put a board on the ray of a pixel, facing the camera but for its tilt: ``facing . tilted . rolled``.

    The shortest turn from the camera's axis z to the ray r is about ``z x r``, by ``arccos r_z``. The tilt is about an
    axis across the ray, at the angle `side`; the roll is about the board's normal.
    """
    x, y = pixel_rays((aim + np.array([lens.cx, lens.cy]))[None], lens)[0]
    ray = np.array([x, y, 1.0]) / np.linalg.norm([x, y, 1.0])
    axis = np.cross([0.0, 0.0, 1.0], ray)
    angle = float(np.arccos(ray[2]))
    facing = _turn(axis / max(float(np.linalg.norm(axis)), 1e-12) * angle)
    tilted = _turn(np.array([np.cos(side), np.sin(side), 0.0]) * tilt)
    return BoardPose(facing @ tilted @ _turn(np.array([0.0, 0.0, roll])), ray * distance)


def _turn(vector: Array) -> Array:
    """Rotation matrix (3, 3) of a turn about a vector, by its length in rad (Rodrigues)."""
    return np.asarray(cv2.Rodrigues(vector)[0], np.float64)


def _in_view(board: Board, lens: CameraConfig, pose: BoardPose) -> float:
    """Share of the board's corners in the image; a chessboard needs 1.3 squares of white around them as well."""
    points = pose.place(board, board.corners)
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), *lens_arrays(lens))[0][:, 0]
    spare = 0.0 if board.kind == "charuco" else 1.3 * board.square * lens.fx / float(points[:, 2].min())
    inside = (pixels > spare).all(axis=1) & (pixels < np.array([lens.width, lens.height]) - 1 - spare).all(axis=1)
    return float((inside & (points[:, 2] > 0)).mean())
