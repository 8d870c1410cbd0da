"""Pictures of the simulation from behind, from above, and through the car's own camera."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Image
from tral_env.checks import one_of
from tral_env.course.scene import PREFIX
from tral_env.perception.camera import SceneRenderer
from tral_env.simulation.render_scene import RenderScene
from tral_env.simulation.sim import Simulation
from tral_env.simulation.vision import Webcam

VIEWS = {"chase": f"{PREFIX}chase", "top": f"{PREFIX}top", "onboard": f"{PREFIX}front"}
"""Names of the views and the cameras that give them."""


def fitted(image: Image, width: int, height: int) -> Image:
    """The whole of an image in a picture of another size, in its own proportions, with black beside it.

    Args:
        image: (h, w, 3) uint8.
        width: px.
        height: px.

    Returns:
        (height, width, 3) uint8.
    """
    scale = min(width / image.shape[1], height / image.shape[0])
    wide, high = max(round(image.shape[1] * scale), 1), max(round(image.shape[0] * scale), 1)
    resized = cv2.resize(image, (wide, high), interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    picture = np.zeros((height, width, 3), np.uint8)
    top, left = (height - high) // 2, (width - wide) // 2
    picture[top : top + high, left : left + wide] = resized
    return picture


class Views:
    """Renders the cars of a simulation."""

    def __init__(self) -> None:
        """OpenGL is opened with the first picture."""
        self._renderer = SceneRenderer(offsamples=0)
        self._sim: Simulation | None = None
        self._scene: RenderScene | None = None
        self._webcam: Webcam | None = None

    def render(self, sim: Simulation, view: str, row: int, width: int, height: int) -> NDArray[np.uint8]:
        """Picture of a car.

        "onboard" is the image that the car's camera took last. A projected camera takes none: then it is the image that
        the camera would take now, with the same lens, mounting and faults.

        Args:
            sim: the simulation.
            view: one of `VIEWS`.
            row: which car.
            width: px.
            height: px.

        Returns:
            (height, width, 3) uint8.

        Raises:
            ConfigError: unknown view.
            RenderError: no OpenGL on this machine.
        """
        one_of("view", view, VIEWS)
        if sim is not self._sim:
            self._forget()
            self._sim = sim
        if view == "onboard":
            return fitted(self._onboard(sim, row), width, height)
        if self._scene is None:
            self._scene = RenderScene(sim.pool)
        model, data = self._scene.show(sim.plan(row), sim.physics.qpos[row])
        return self._renderer.render(model, data, VIEWS[view], width, height)

    def _onboard(self, sim: Simulation, row: int) -> Image:
        plan = sim.plan(row)
        taken = sim.cameras.vision.last_image(row)
        if taken is not None:
            return taken
        if self._webcam is None:
            self._webcam = Webcam(1, sim.pool, sim.lens, sim.image_faults)
        # The noise is that of the exposure: it stays until the camera would take its next image.
        seed = int(sim.cameras.image_seeds[row] + sim.cameras.exposures[row])
        self._webcam.place(0, plan, float(sim.car_parameters.drawn["image_degradation"][row]), seed)
        return self._webcam.image(0, sim.physics.qpos[row], sim.cameras.mounting(np.array([row]))[0])

    def _forget(self) -> None:
        """Drop what belongs to another simulation."""
        if self._webcam is not None:
            self._webcam.close()
        self._scene = self._webcam = None

    def close(self) -> None:
        """Free the OpenGL contexts."""
        self._forget()
        self._sim = None
        self._renderer.close()
