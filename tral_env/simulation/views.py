"""Pictures of the simulation from behind, from above, and through the car's own camera."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from tral_env.arrays import Array, Image
from tral_env.checks import one_of
from tral_env.config import CameraConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import PREFIX, Pool
from tral_env.perception import opengl
from tral_env.perception.camera import SceneRenderer
from tral_env.perception.degrade import ImageCorruption
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Still:
    """What a view shows at one moment; it can be rendered later, when the car has moved on."""

    view: str
    """One of `VIEWS`."""
    pool: Pool
    """How many boxes and markers the course may have at the most."""
    plan: Plan
    """The course."""
    qpos: Array
    """(nq,) state of the car."""
    image: Image | None = None
    """The whole picture, where it is there already."""
    exposure: Exposure | None = None
    """How the car's camera would take the picture, where it has taken none."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Exposure:
    """How a car's camera takes an image."""

    lens: CameraConfig
    faults: ImageCorruption | None
    mounting: Array
    """(3,) roll, pitch, yaw of the mounting error, rad."""
    degradation: float
    """Level of the image's faults."""
    seed: int
    """Seed of the noise in the image."""


def still(sim: Simulation, view: str, row: int) -> Still:
    """Keep what a view of a car shows now.

    "onboard" is the image that the car's camera took last. A projected camera takes none: then it is the image that
    the camera would take now, with the same lens, mounting and faults.

    Args:
        sim: the simulation.
        view: one of `VIEWS`.
        row: which car.

    Raises:
        ConfigError: unknown view, or the car has no course yet.
        RenderError: no OpenGL on this machine.
    """
    one_of("view", view, VIEWS)
    kept = Still(view=view, pool=sim.pool, plan=sim.plan(row), qpos=sim.physics.qpos[row].copy())
    if view != "onboard":
        return kept
    taken = sim.cameras.vision.last_image(row)
    if taken is not None:
        return replace(kept, image=taken)
    exposure = Exposure(
        lens=sim.lens,
        faults=sim.image_faults,
        mounting=sim.cameras.mounting(np.array([row]))[0],
        degradation=float(sim.car_parameters.drawn["image_degradation"][row]),
        # The noise is that of the exposure: it stays until the camera would take its next image.
        seed=int(sim.cameras.image_seeds[row] + sim.cameras.exposures[row]),
    )
    return replace(kept, exposure=exposure)


class Views:
    """Renders stills; all views share one OpenGL context."""

    def __init__(self) -> None:
        """OpenGL is opened with the first picture."""
        self._renderer = SceneRenderer(offsamples=0)
        self._scene: RenderScene | None = None
        self._pool: Pool | None = None
        self._webcam: Webcam | None = None
        self._lens: tuple[CameraConfig, ImageCorruption | None] | None = None

    def render(self, still: Still, width: int, height: int) -> Image:
        """Picture of a still, (height, width, 3) uint8.

        Raises:
            RenderError: no OpenGL on this machine.
        """
        if still.image is not None:
            return fitted(still.image, width, height)
        if self._scene is None or self._pool != still.pool:
            self._scene, self._pool, self._webcam = RenderScene(still.pool), still.pool, None
        if still.exposure is not None:
            return fitted(self._onboard(still, still.exposure), width, height)
        model, data = self._scene.show(still.plan, still.qpos)
        return self._renderer.render(model, data, VIEWS[still.view], width, height)

    def _onboard(self, still: Still, exposure: Exposure) -> Image:
        lens = exposure.lens, exposure.faults
        if self._webcam is None or self._lens != lens:
            self._webcam = Webcam(1, still.pool, *lens, scene=self._scene, renderer=self._renderer)
            self._lens = lens
        self._webcam.place(0, still.plan, exposure.degradation, exposure.seed)
        return self._webcam.image(0, still.qpos, exposure.mounting)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._scene = self._pool = self._webcam = self._lens = None
        self._renderer.close()


class Stills:
    """Pictures that are taken now and rendered later, in another thread where OpenGL can work in any."""

    def __init__(self, keep: Callable[[str], Still]) -> None:
        """OpenGL is opened with the first picture.

        Args:
            keep: gives what a view shows now.
        """
        self._keep = keep
        self._views = Views()
        self._thread: int | None = None

    def take(self, view: str, width: int, height: int) -> Callable[[], Image]:
        """What a view shows now, as a function that renders it, (height, width, 3) uint8.

        Call all these functions in one thread, and `close` in the same.

        Raises:
            ConfigError: an unknown view, or there was no reset.
            RenderError: no OpenGL on this machine.
        """
        kept = self._keep(view)
        if opengl.works_in_threads():
            return lambda: self._render(kept, width, height)
        image = self._render(kept, width, height)
        return lambda: image

    def _render(self, kept: Still, width: int, height: int) -> Image:
        self._thread = threading.get_ident()
        return self._views.render(kept, width, height)

    def close(self) -> None:
        """Free the OpenGL context, if this is the thread that opened it."""
        if self._thread in (None, threading.get_ident()):
            self._views.close()
