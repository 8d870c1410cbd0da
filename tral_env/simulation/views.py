"""Pictures of the simulation from behind, from above, and through the car's own camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.course.scene import PREFIX
from tral_env.errors import ConfigError, nearest
from tral_env.perception.camera import SceneRenderer
from tral_env.simulation.render_scene import RenderScene
from tral_env.simulation.sim import Simulation

VIEWS = {"chase": f"{PREFIX}chase", "top": f"{PREFIX}top", "onboard": f"{PREFIX}front"}
"""Names of the views and the cameras that give them."""


class Views:
    """Renders the cars of a simulation."""

    def __init__(self) -> None:
        """OpenGL is opened with the first picture."""
        self._renderer = SceneRenderer(offsamples=0)
        self._sim: Simulation | None = None
        self._scene: RenderScene | None = None

    def render(self, sim: Simulation, view: str, row: int, width: int, height: int) -> NDArray[np.uint8]:
        """Picture of a car.

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
        if view not in VIEWS:
            raise ConfigError(f"unknown view '{view}': {nearest(view, VIEWS)}")
        if self._scene is None or sim is not self._sim:
            self._sim, self._scene = sim, RenderScene(sim.pool)
        model, data = self._scene.show(sim.plan(row), sim.physics.qpos[row])
        return self._renderer.render(model, data, VIEWS[view], width, height)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._renderer.close()
