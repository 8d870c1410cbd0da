"""The images of n cars' cameras as an observation: each comes after the camera's latency."""

from __future__ import annotations

from collections import deque

import numpy as np

from tral_env.arrays import Array, Image, Index
from tral_env.config import CameraConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool
from tral_env.perception.camera_pipeline import has_arrived
from tral_env.perception.degrade import ImageCorruption
from tral_env.simulation.vision import Webcam


class Pixels:
    """The last image of each car that has arrived; black before the first one."""

    def __init__(
        self, n: int, size: tuple[int, int], pool: Pool, lens: CameraConfig, corruption: ImageCorruption | None
    ) -> None:
        """OpenGL is opened with the first image.

        Args:
            n: number of cars.
            size: width and height of the images, px.
            pool: how many boxes and markers a course may have at the most.
            lens: of the camera, whose images have a size of their own.
            corruption: how much of each fault a level of degradation brings to an image of the lens's size.
        """
        faults = (corruption or ImageCorruption()).scaled(size[0] / lens.width)
        self._webcam = Webcam(n, pool, lens.scaled(*size), faults)
        self._on_the_way: list[deque[tuple[float, Image]]] = [deque() for _ in range(n)]
        self.images = np.zeros((n, size[1], size[0], 3), np.uint8)
        """(n, height, width, 3) RGB."""

    def place(self, row: int, plan: Plan, degradation: float, seed: int) -> None:
        """Put a course around a car, see `Vision`."""
        self._webcam.place(row, plan, degradation, seed)

    def reset(self, rows: Index) -> None:
        """Forget the images of cars (k,)."""
        self.images[rows] = 0
        for row in rows.tolist():
            self._on_the_way[row].clear()

    def expose(self, rows: Index, time_s: Array, qpos: Array, mounting: Array) -> None:
        """Take images.

        Args:
            rows: (k,) cars whose cameras were triggered.
            time_s: (n,) now, s.
            qpos: (k, nq) states of the cars.
            mounting: (k, 3) roll, pitch, yaw of the cameras' mounting errors, rad.

        Raises:
            RenderError: no OpenGL on this machine.
        """
        for i, row in enumerate(rows.tolist()):
            image = self._webcam.image(row, qpos[i], mounting[i])
            self._on_the_way[row].append((float(time_s[row]), image))

    def deliver(self, time_s: Array, latency_s: Array) -> None:
        """Show the images whose latency is over; both (n,), s."""
        for row, queue in enumerate(self._on_the_way):
            while queue and has_arrived(queue[0][0], latency_s[row], time_s[row]):
                self.images[row] = queue.popleft()[1]

    def close(self) -> None:
        """Free the OpenGL context."""
        self._webcam.close()
