"""The cameras of n cars: when they look, how they are mounted, what they see, and when that is known."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Array, Index, Rows
from tral_env.course.plan import Plan
from tral_env.perception.camera_pipeline import CameraPipeline
from tral_env.perception.false_sightings import FalseSightings
from tral_env.simulation.parameters import CarParameters
from tral_env.simulation.physics import Physics
from tral_env.simulation.pixels import Pixels
from tral_env.simulation.truth import GroundTruth
from tral_env.simulation.vision import Vision


class Cameras:
    """Exposes images in the cameras' rate and delivers what they show after the latency."""

    def __init__(
        self,
        n: int,
        rate_hz: float,
        vision: Vision,
        false_sightings: FalseSightings,
        physics: Physics,
        truth: GroundTruth,
        parameters: CarParameters,
        pixels: Pixels | None = None,
    ) -> None:
        """Nothing seen yet; `pixels` are the images that are observed, if there are any."""
        self.vision = vision
        self._false_sightings = false_sightings
        self._pipeline = CameraPipeline(n, rate_hz)
        self._physics, self._truth, self._parameters = physics, truth, parameters
        self.pixels = pixels
        self._mounting = np.zeros((n, 3))
        self.image_seeds = np.zeros(n, np.int64)
        """(n,) seeds of the noise in the images."""
        self.exposures = np.zeros(n, np.int64)
        """(n,) number of images that each camera has taken on its course."""

    def place(self, row: int, plan: Plan, degradation: float, rng: np.random.Generator) -> None:
        """Put a course around a car, see `Vision`; the generator gives the seed of its images' noise."""
        self.image_seeds[row] = rng.integers(2**32)
        self.vision.place(row, plan, degradation, int(self.image_seeds[row]))
        if self.pixels is not None:
            self.pixels.place(row, plan, degradation, int(self.image_seeds[row]))

    def reset(self, rows: Index) -> None:
        """Forget what cars (k,) saw, and let them look."""
        for row in rows.tolist():
            rate = float(self._parameters.drawn["false_sighting_rate"][row])
            self._false_sightings.reset(row, rate, int(self.image_seeds[row]))
        for i, axis in enumerate(("roll", "pitch", "yaw")):
            self._mounting[rows, i] = np.radians(self._parameters.drawn[f"camera_{axis}_deg"][rows])
        self._pipeline.reset(rows, self._parameters.drawn["camera_latency_s"][rows])
        if self.pixels is not None:
            self.pixels.reset(rows)
        self.exposures[rows] = 0
        self.update(rows)

    def update(self, moving: Rows) -> None:
        """Expose the images that are due in the cars (k,) that move, and deliver those that have arrived."""
        time_s = self._physics.time_s
        rows = self._pipeline.trigger(moving, time_s)
        if len(rows):
            self.exposures[rows] += 1
            qpos, mounting = self._physics.qpos[rows], self.mounting(rows)
            seen = self.vision.see(rows, self._truth.pose[rows], qpos, mounting)
            self._false_sightings.add(rows, seen)
            self._pipeline.expose(rows, time_s, seen)
            if self.pixels is not None:
                self.pixels.expose(rows, time_s, qpos, mounting)
        self._pipeline.deliver(time_s)
        if self.pixels is not None:
            self.pixels.deliver(time_s, self._parameters.drawn["camera_latency_s"])

    def mounting(self, rows: Index) -> Array:
        """(k, 3) roll, pitch, yaw of the cameras' mounting errors, rad."""
        errors: Array = self._mounting[rows]
        return errors

    def close(self) -> None:
        """Free what OpenGL holds."""
        self.vision.close()
        if self.pixels is not None:
            self.pixels.close()

    def readings(self) -> dict[str, Array]:
        """``gate_id`` .. ``marker_age``, (n,) each."""
        return self._pipeline.readings(self._physics.time_s)
