"""A calibration board before the simulated camera, and nothing else: to calibrate without a camera."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import cv2
import mujoco
import numpy as np

from tral_env.arrays import Image
from tral_env.calibration.board_poses import BoardPose, seeded_poses
from tral_env.calibration.boards import Board
from tral_env.config import CameraConfig
from tral_env.perception.camera import OnboardCamera, SceneRenderer
from tral_env.perception.degrade import degrade

MARGIN = 0.02
"""Width of the white margin around the squares, m."""
PIXELS_PER_METRE = 4000.0
"""Resolution of the board's texture, px/m: four pixels a millimetre."""
MAX_PIXELS = 4096
"""Largest side of the texture, px."""

_SCENE = """
<mujoco>
  <visual>
    <headlight ambient="0.55 0.55 0.55" diffuse="0.4 0.4 0.4" specular="0 0 0"/>
    <map znear="0.01" zfar="20"/>
  </visual>
  <asset>
    <texture name="room" type="skybox" builtin="gradient" rgb1=".5 .5 .5" rgb2=".3 .3 .3" width="64" height="64"/>
    <texture name="board" type="2d" file="board.png"/>
    <material name="board" texture="board" specular="0" shininess="0"/>
  </asset>
  <worldbody>
    <camera name="camera" pos="0 0 0"/>
    <body name="board" mocap="true">
      <geom name="board" type="box" size="{x} {y} 0.001" pos="0 0 -0.001" material="board"/>
    </body>
  </worldbody>
</mujoco>
"""

_FLIP = np.diag([1.0, -1.0, -1.0])
"""Between OpenCV's axes, y down and z forward, and MuJoCo's, y up and z back."""


def pixels_per_metre(board: Board) -> float:
    """Resolution of a board's texture, px/m."""
    return min(PIXELS_PER_METRE, MAX_PIXELS / (max(board.size) + 2 * MARGIN))


class BoardScene:
    """A board that can be put anywhere before a camera."""

    def __init__(self, board: Board, lens: CameraConfig, *, degradation: float = 0.0, seed: int = 0) -> None:
        """OpenGL is opened with the first image.

        Args:
            board: what is shown.
            lens: of the camera.
            degradation: noise, blur, exposure and glare of the images, see `degrade`.
            seed: of these faults.
        """
        ok, png = cv2.imencode(".png", board.image(pixels_per_metre(board), MARGIN))
        assert ok, "a grey image can be written as PNG"
        half = (length / 2 + MARGIN for length in board.size)
        scene = _SCENE.format(x=next(half), y=next(half))
        self._model = mujoco.MjModel.from_xml_string(scene, {"board.png": png.tobytes()})
        self._data = mujoco.MjData(self._model)
        self._camera = OnboardCamera(lens, camera="camera", renderer=SceneRenderer(offsamples=4))
        self._degradation, self._rng = degradation, np.random.default_rng(seed)

    def capture(self, pose: BoardPose) -> Image:
        """Image of the board in a pose, (lens.height, lens.width, 3).

        Raises:
            RenderError: no OpenGL on this machine.
        """
        turn = np.ascontiguousarray(_FLIP @ pose.rotation @ _FLIP)
        self._data.mocap_pos[0] = _FLIP @ pose.middle
        mujoco.mju_mat2Quat(self._data.mocap_quat[0], turn.ravel())
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        return degrade(self._camera.capture(self._model, self._data), self._degradation, self._rng)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._camera.close()


def simulated_images(board: Board, lens: CameraConfig, count: int, seed: int) -> Iterator[tuple[str, Image]]:
    """Names and images of a board in `count` poses before the simulated camera, mildly degraded.

    Raises:
        RenderError: no OpenGL on this machine.
    """
    with contextlib.closing(BoardScene(board, lens, degradation=1.0, seed=seed)) as scene:
        for i, pose in enumerate(seeded_poses(board, lens, count, seed)):
            yield f"simulated_{i:03d}", scene.capture(pose)
