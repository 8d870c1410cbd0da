"""Render the picture of docs/car.md: the car from the front, from behind, from the chase camera and from above.

Usage: python benchmarks/plot_car.py [FILE]        (default: docs/img/car.png)
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2
import gymnasium as gym
import mujoco
import numpy as np
from numpy.typing import NDArray

from tral_env.simulation.render_scene import RenderScene
from tral_env.simulation.views import VIEWS

WIDTH, HEIGHT = 500, 375
DISTANCE_M = 0.65
"""Distance of a close camera from the middle of the car."""
CLOSE = {"from the front": (215.0, -16.0), "from behind": (-35.0, -20.0)}
"""Azimuth and elevation of the view onto the car, deg; at 0 the camera looks along x."""


def close_camera(at: NDArray[np.float64], azimuth: float, elevation: float) -> mujoco.MjvCamera:
    """A camera that looks at a point."""
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:] = at
    camera.distance, camera.azimuth, camera.elevation = DISTANCE_M, azimuth, elevation
    return camera


def main(path: Path) -> None:
    """Write the picture."""
    env: Any = gym.make("tral_env:TralCorridor-v0", scenario="straight", randomization="none")
    env.reset(seed=3)
    for _ in range(40):
        env.step(np.array([0.6, 0.2], np.float32))
    sim = env.unwrapped.world.sim
    scene = RenderScene(sim.pool)
    model, data = scene.show(sim.plan(0), sim.physics.qpos[0])
    model.vis.quality.shadowsize, model.vis.quality.offsamples = 2048, 8
    model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
    x, y, yaw = sim.pose[0]
    at = np.array([x + 0.13 * np.cos(yaw), y + 0.13 * np.sin(yaw), 0.09])
    cameras = [close_camera(at, np.degrees(yaw) + azimuth, elevation) for azimuth, elevation in CLOSE.values()]
    pictures = []
    option = mujoco.MjvOption()
    option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        for camera in [*cameras, VIEWS["chase"], VIEWS["top"]]:
            renderer.update_scene(data, camera, option)
            pictures.append(renderer.render())
    above, below = np.hstack(pictures[:2]), np.hstack(pictures[2:])
    cv2.imwrite(str(path), np.vstack([above, below])[:, :, ::-1])
    env.close()
    print(f"written: {path}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/img/car.png"))
