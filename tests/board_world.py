"""A calibration board as a distorting lens sees it, without MuJoCo: each pixel follows its ray to the board."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from tral_env.calibration.board_poses import BoardPose
from tral_env.calibration.boards import Board
from tral_env.config import CameraConfig
from tral_env.perception.rays import pixel_rays

MARGIN = 0.02
SAMPLES = 2
"""Rays across and down in each pixel."""


@lru_cache(maxsize=4)
def rays(lens: CameraConfig):
    step = 1 / SAMPLES
    u = np.arange(lens.width * SAMPLES) * step - 0.5 + step / 2
    v = np.arange(lens.height * SAMPLES) * step - 0.5 + step / 2
    flat = pixel_rays(np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2), lens)
    return np.column_stack([flat, np.ones(len(flat))]).astype(np.float32)


@lru_cache(maxsize=4)
def texture(board: Board, pixels_per_metre: float):
    return board.image(pixels_per_metre, MARGIN)


def photograph(board: Board, lens: CameraConfig, pose: BoardPose, blur: float = 0.5, background: int = 110):
    """(h, w) grey image."""
    scale = 1.5 * SAMPLES * lens.fx / np.linalg.norm(pose.middle)
    paper = texture(board, float(2 ** np.round(np.log2(scale))))
    per_metre = paper.shape[1] / (board.size[0] + 2 * MARGIN)
    back = np.linalg.inv(pose.rotation).astype(np.float32)
    towards, origin = rays(lens) @ back.T, back @ pose.middle
    # A ray along the board never meets it; one away from it meets it behind the camera.
    reach = origin[2] / np.where(towards[:, 2] == 0, 1e-9, towards[:, 2])
    place = towards[:, :2] * reach[:, None] - origin[:2]
    spot = (place + np.array(board.size) / 2 + MARGIN) * per_metre - 0.5
    spot[reach <= 0] = -10
    across, down = (spot[:, i].reshape(lens.height * SAMPLES, -1).astype(np.float32) for i in (0, 1))
    fine = cv2.remap(paper, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=background)
    image = cv2.resize(fine, (lens.width, lens.height), interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(image, (0, 0), blur) if blur else image
