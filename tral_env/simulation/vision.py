"""The vision of n cars: what their cameras see of gates and markers, projected or rendered."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from tral_env.arrays import Array, Image, Index
from tral_env.config import CameraConfig, CarConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool
from tral_env.noise import NoiseTape
from tral_env.perception.aruco import Detector, marker_poses
from tral_env.perception.camera import OnboardCamera
from tral_env.perception.degrade import ImageCorruption, degrade
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


class _Shot(NamedTuple):
    """What an image depends on, so that it can be taken again instead of being kept."""

    qpos: Array
    mounting: Array
    generator: dict[str, Any]
    """State of the generator of its noise."""


class Webcam:
    """The images that n cars' cameras take: through the lens, mounted askew, degraded as a webcam does."""

    def __init__(self, n: int, pool: Pool, lens: CameraConfig, corruption: ImageCorruption | None = None) -> None:
        """OpenGL is opened with the first image; `corruption` is how much of each fault a level brings."""
        self._scene = RenderScene(pool)
        self._plans: list[Plan | None] = [None] * n
        self._rngs = [np.random.default_rng(0) for _ in range(n)]
        self._degradation = np.zeros(n)
        self._shots: dict[int, _Shot] = {}
        self._camera = OnboardCamera(lens)
        self._corruption = corruption

    def place(self, row: int, plan: Plan, degradation: float, seed: int) -> None:
        """See `Vision`."""
        self._plans[row] = plan
        self._shots.pop(row, None)
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
        state = self._rngs[row].bit_generator.state
        self._shots[row] = _Shot(qpos.copy(), mounting.copy(), dict(state))
        return self._take(row, qpos, mounting, self._rngs[row])

    def last_image(self, row: int) -> Image | None:
        """The last image of one car, bit for bit; None before the first."""
        shot = self._shots.get(row)
        if shot is None:
            return None
        rng = np.random.default_rng()
        rng.bit_generator.state = shot.generator
        return self._take(row, shot.qpos, shot.mounting, rng)

    def _take(self, row: int, qpos: Array, mounting: Array, rng: np.random.Generator) -> Image:
        plan = self._plans[row]
        assert plan is not None, "a car looks around after its course was placed"
        roll, pitch, yaw = (float(angle) for angle in mounting)
        image = self._camera.capture(*self._scene.show(plan, qpos), (roll, pitch, yaw))
        return degrade(image, float(self._degradation[row]), rng, self._corruption)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._camera.close()


class RenderedVision:
    """The image of the camera, rendered and searched by OpenCV's detector."""

    def __init__(
        self, n: int, pool: Pool, lens: CameraConfig, car: CarConfig, corruption: ImageCorruption | None = None
    ) -> None:
        """OpenGL is opened with the first image; `corruption` is how much of each fault a level brings."""
        self._webcam = Webcam(n, pool, lens, corruption)
        self._detector = Detector()
        self._lens, self._car = lens, car

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
        image = self._webcam.image(row, qpos, mounting)
        poses = marker_poses(self._detector.detect(image), self._lens, self._car)
        return nearest_in_image(poses)

    def last_image(self, row: int) -> Image | None:
        """See `Vision`."""
        return self._webcam.last_image(row)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._webcam.close()
