"""Seeded poses of a calibration board before a camera, as a person moves it who knows what a calibration needs."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.calibration.boards import Board
from tral_env.config import CameraConfig
from tral_env.perception.rays import lens_arrays, pixel_rays

Array = NDArray[np.float64]

TILT_DEG, ROLL_DEG = 45.0, 40.0
"""Largest angles: between the board's normal and the line of sight, and around it."""
SHARE = (0.3, 0.8)
"""Width of the board as a share of the image's."""
TRIES = 10


@dataclass(frozen=True)
class BoardPose:
    """Where a board is, in the camera's frame: x right, y down, z forward."""

    rotation: Array
    """(3, 3) its axes."""
    middle: Array
    """(3,) m: its middle."""

    def place(self, board: Board, points: Array) -> Array:
        """Points of the board, (k, 3) m in its own frame, seen from the camera."""
        return (points - [board.size[0] / 2, board.size[1] / 2, 0.0]) @ self.rotation.T + self.middle


def seeded_poses(board: Board, lens: CameraConfig, count: int, seed: int) -> list[BoardPose]:
    """Poses all over the image, near and far, tilted to all sides: each spread evenly, in random company.

    A ChArUco board may hang over the edge of the image with four tenths of its corners, a chessboard not at all.

    Args:
        board: what is moved.
        lens: of the camera.
        count: how many.
        seed: the same gives the same poses.
    """
    rng = np.random.default_rng(seed)
    spread = (np.array([rng.permutation(count) for _ in range(6)]) + rng.uniform(size=(6, count))) / count
    return [_pose(board, lens, *(float(value) for value in values)) for values in spread.T]


def _pose(
    board: Board, lens: CameraConfig, u: float, v: float, nearness: float, tilt: float, side: float, roll: float
) -> BoardPose:
    aim = np.array([lens.width * _outward(u) - lens.cx, lens.height * _outward(v) - lens.cy])
    share = SHARE[0] + (SHARE[1] - SHARE[0]) * nearness
    angles = np.radians([TILT_DEG * tilt, 360.0 * side, ROLL_DEG * (2 * roll - 1)])
    needed = 0.6 if board.kind == "charuco" else 1.0
    for attempt in range(TRIES):
        # Nearer to the middle, and farther away if that is not enough.
        inward = 1.0 - attempt / (TRIES - 1)
        distance = board.size[0] * lens.fx / (share * lens.width) * (1.0 + 0.05 * attempt)
        pose = _towards(lens, aim * inward, distance, *(float(angle) for angle in angles))
        if _in_view(board, lens, pose) >= needed:
            break
    return pose


def _outward(share: float) -> float:
    """A place from 0 to 1, moved towards the nearer end: the image's edge tells most about distortion."""
    off = 2.0 * share - 1.0
    return float(0.5 + 0.5 * np.copysign(np.sqrt(abs(off)), off))


def _towards(lens: CameraConfig, aim: Array, distance: float, tilt: float, side: float, roll: float) -> BoardPose:
    """A board on the ray of a pixel, facing the camera but for its tilt."""
    x, y = pixel_rays((aim + np.array([lens.cx, lens.cy]))[None], lens)[0]
    ray = np.array([x, y, 1.0]) / np.linalg.norm([x, y, 1.0])
    axis = np.cross([0.0, 0.0, 1.0], ray)
    angle = float(np.arccos(ray[2]))
    facing = _turn(axis / max(float(np.linalg.norm(axis)), 1e-12) * angle)
    tilted = _turn(np.array([np.cos(side), np.sin(side), 0.0]) * tilt)
    return BoardPose(facing @ tilted @ _turn(np.array([0.0, 0.0, roll])), ray * distance)


def _turn(vector: Array) -> Array:
    return np.asarray(cv2.Rodrigues(vector)[0], np.float64)


def _in_view(board: Board, lens: CameraConfig, pose: BoardPose) -> float:
    """Share of the corners that are in the image, with a square to spare if all must be."""
    points = pose.place(board, board.corners)
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), *lens_arrays(lens))[0][:, 0]
    spare = 0.0 if board.kind == "charuco" else 1.3 * board.square * lens.fx / float(points[:, 2].min())
    inside = (pixels > spare).all(axis=1) & (pixels < np.array([lens.width, lens.height]) - 1 - spare).all(axis=1)
    return float((inside & (points[:, 2] > 0)).mean())
