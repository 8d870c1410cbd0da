"""The vision of n cars: what their cameras see of gates and markers, projected or rendered."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from tral_env.arrays import Array, Image, Index
from tral_env.config import CameraConfig, CarConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool
from tral_env.noise import NoiseTape
from tral_env.perception.aruco import Detector, marker_poses
from tral_env.perception.camera import OnboardCamera, SceneRenderer
from tral_env.perception.degrade import DrawnFaults, ImageCorruption, draw_faults, with_faults
from tral_env.perception.gate import Detection, nearest_gate_and_marker, nearest_in_image
from tral_env.perception.projected import NOISE_PLACES, NORMALS, UNIFORMS, Scenery, project
from tral_env.simulation.render_scene import RenderScene


class Vision(Protocol):
    """How cars see: what their cameras show of gates and markers."""

    def place(self, row: int, plan: Plan, degradation: float, seed: int) -> None:
        """Put a course around a car.

        Args:
            row: which car.
            plan: its course.
            degradation: level of its images' faults, see `degrade`.
            seed: of the noise in its images.
        """

    def see(self, rows: Index, pose: Array, qpos: Array, mounting: Array) -> Detection:
        """What the cameras of the rows see now.

        Args:
            rows: (k,) cars.
            pose: (k, 3) x, y, yaw.
            qpos: (k, nq) full state.
            mounting: (k, 3) roll, pitch, yaw of the cameras' mounting error, rad.

        Returns:
            Arrays of (k,).
        """
        ...

    def last_image(self, row: int) -> Image | None:
        """The image that a car's camera took last, bit for bit; None if the cameras take no images."""
        ...

    def close(self) -> None:
        """Free what OpenGL holds."""


class ProjectedVision:
    """Marker corners projected through the lens; no OpenGL."""

    def __init__(self, n: int, noise: NoiseTape, lens: CameraConfig, car: CarConfig) -> None:
        """Nothing to see yet."""
        self._scenery = Scenery(n)
        self._markers = np.zeros(n, np.int64)
        self._degradation = np.zeros(n)
        self._noise, self._lens, self._car = noise, lens, car

    def place(self, row: int, plan: Plan, degradation: float, seed: int) -> None:
        """See `Vision`."""
        self._scenery.place(row, plan)
        self._markers[row], self._degradation[row] = len(plan.marker_id), degradation

    def see(self, rows: Index, pose: Array, qpos: Array, mounting: Array) -> Detection:
        """See `Vision`."""
        detection = Detection.nothing(len(rows))
        # Rows without markers draw no noise, whether they are alone or among others.
        some = np.flatnonzero(self._markers[rows])
        if len(some):
            detection.put(some, self._see(rows[some], pose[some], mounting[some]))
        return detection

    def _see(self, rows: Index, pose: Array, mounting: Array) -> Detection:
        normal = self._noise.normal(rows, NOISE_PLACES * NORMALS).reshape(-1, NOISE_PLACES, NORMALS)
        uniform = self._noise.uniform(rows, NOISE_PLACES * UNIFORMS).reshape(-1, NOISE_PLACES, UNIFORMS)
        seen = project(
            self._scenery,
            rows,
            pose,
            self._lens,
            self._car,
            mounting=mounting,
            normal=normal,
            uniform=uniform,
            degradation=self._degradation[rows],
        )
        return nearest_gate_and_marker(seen.ids, seen.x, seen.y, seen.heading, seen.valid)

    def last_image(self, row: int) -> Image | None:
        """See `Vision`."""
        return None

    def close(self) -> None:
        """Nothing to free."""


_MARKER_REACH = 1.5
"""A marker with its white edge lies within so many times its size around its middle."""


class _Shot(NamedTuple):
    """What an image depends on, so that it can be taken later or again instead of being kept."""

    qpos: Array
    mounting: Array
    faults: DrawnFaults | None


class Webcam:
    """The images that n cars' cameras take: through the lens, mounted askew, degraded as a webcam does."""

    def __init__(
        self,
        n: int,
        pool: Pool,
        lens: CameraConfig,
        corruption: ImageCorruption | None = None,
        *,
        scene: RenderScene | None = None,
        renderer: SceneRenderer | None = None,
    ) -> None:
        """OpenGL is opened with the first image.

        Args:
            n: number of cars.
            pool: how many boxes and markers a course may have at the most.
            lens: of the cameras.
            corruption: how much of each fault a level of degradation brings.
            scene: a scene of this pool that other views share; default: one of its own.
            renderer: a renderer that other views share; default: one of its own.
        """
        self._scene = scene or RenderScene(pool)
        self._plans: list[Plan | None] = [None] * n
        self._rngs = [np.random.default_rng(0) for _ in range(n)]
        self._degradation = np.zeros(n)
        self._shots: dict[int, _Shot] = {}
        self._watched: dict[int, Image | None] = {}
        """The last images of the cars that somebody watches."""
        self._camera = OnboardCamera(lens, renderer=renderer)
        self._corruption = corruption

    def place(self, row: int, plan: Plan, degradation: float, seed: int) -> None:
        """See `Vision`."""
        self._plans[row] = plan
        self._shots.pop(row, None)
        if row in self._watched:
            self._watched[row] = None
        self._degradation[row], self._rngs[row] = degradation, np.random.default_rng(seed)

    def image(self, row: int, qpos: Array, mounting: Array) -> Image:
        """Image of one car now.

        Args:
            row: which car.
            qpos: (nq,) its state.
            mounting: (3,) roll, pitch, yaw of the mounting error, rad.

        Raises:
            RenderError: no OpenGL on this machine.
        """
        self.expose(row, qpos, mounting)
        return self.developed(row)

    def expose(self, row: int, qpos: Array, mounting: Array) -> None:
        """Keep all on which the image of one car now depends, see `image`; `developed` renders it."""
        size = self._camera.config.height, self._camera.config.width
        drawn = draw_faults(size, float(self._degradation[row]), self._rngs[row], self._corruption)
        self._shots[row] = _Shot(qpos.copy(), mounting.copy(), drawn)
        if row in self._watched:
            self._watched[row] = None

    def developed(self, row: int) -> Image:
        """The image of the last exposure of one car.

        Raises:
            RenderError: no OpenGL on this machine.
        """
        plan, shot = self._plans[row], self._shots[row]
        assert plan is not None, "a car looks around after its course was placed"
        roll, pitch, yaw = shot.mounting.tolist()
        image = self._camera.capture(*self._scene.show(plan, shot.qpos), (roll, pitch, yaw))
        image = with_faults(image, float(self._degradation[row]), shot.faults, self._corruption)
        if row in self._watched:
            self._watched[row] = image
        return image

    def may_show_a_marker(self, row: int) -> bool:
        """Whether a marker of the course lies before the camera of one car, at its last exposure; walls may hide it."""
        plan, shot = self._plans[row], self._shots[row]
        assert plan is not None, "a car looks around after its course was placed"
        if not len(plan.marker_id):
            return False
        _, data = self._scene.show(plan, shot.qpos)
        roll, pitch, yaw = shot.mounting.tolist()
        radius = np.full(len(plan.marker_id), _MARKER_REACH * plan.marker_size)
        outside = self._camera.frustum(data, (roll, pitch, yaw)).outside(plan.marker_position, radius)
        return not outside.all()

    def last_image(self, row: int) -> Image | None:
        """The last image of one car, bit for bit; None before the first.

        The first call takes the image once more. From then on the car is watched, and its images are kept.
        """
        image = self._watched.get(row)
        if image is None and row in self._shots:
            image = self.developed(row)
        self._watched[row] = image
        return image

    def close(self) -> None:
        """Free the OpenGL context."""
        self._camera.close()


class RenderedVision:
    """The image of the camera, rendered and searched by OpenCV's detector.

    An image in which no marker can be is not searched, and rendered only if somebody looks at it.
    """

    def __init__(
        self, n: int, pool: Pool, lens: CameraConfig, car: CarConfig, corruption: ImageCorruption | None = None
    ) -> None:
        """OpenGL is opened with the first image; `corruption` is how much of each fault a level brings."""
        self._webcam = Webcam(n, pool, lens, corruption)
        self._detector = Detector()
        self._lens, self._car = lens, car
        # A square before the lens may look like a marker. The first image opens OpenGL, or tells that there is none.
        self._searches_all = corruption is not None and corruption.patch > 0
        self._is_open = False

    def place(self, row: int, plan: Plan, degradation: float, seed: int) -> None:
        """See `Vision`."""
        self._webcam.place(row, plan, degradation, seed)

    def see(self, rows: Index, pose: Array, qpos: Array, mounting: Array) -> Detection:
        """See `Vision`.

        Raises:
            RenderError: no OpenGL on this machine.
        """
        found = [self._look(int(row), qpos[i], mounting[i]) for i, row in enumerate(rows)]
        return Detection(*(np.concatenate([getattr(one, name) for one in found]) for name in Detection.__annotations__))

    def _look(self, row: int, qpos: Array, mounting: Array) -> Detection:
        self._webcam.expose(row, qpos, mounting)
        if self._is_open and not self._searches_all and not self._webcam.may_show_a_marker(row):
            return Detection.nothing(1)
        image = self._webcam.developed(row)
        self._is_open = True
        poses = marker_poses(self._detector.detect(image), self._lens, self._car)
        return nearest_in_image(poses)

    def last_image(self, row: int) -> Image | None:
        """See `Vision`."""
        return self._webcam.last_image(row)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._webcam.close()
