"""The cameras of n cars: when they look, how they are mounted, what they see, and when that is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.course.plan import Plan
from tral_env.perception.camera_pipeline import CameraPipeline
from tral_env.perception.false_sightings import FalseSightings
from tral_env.simulation.parameters import CarParameters
from tral_env.simulation.physics import Physics
from tral_env.simulation.truth import GroundTruth
from tral_env.simulation.vision import Vision

Array = NDArray[np.float64]
Index = NDArray[np.int64]


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
    ) -> None:
        """Nothing seen yet."""
        self.vision = vision
        self._false_sightings = false_sightings
        self._pipeline = CameraPipeline(n, rate_hz)
        self._physics, self._truth, self._parameters = physics, truth, parameters
        self.exposures = np.zeros(n, np.int64)
        """(n,) images exposed since reset."""
        self.image_seeds = np.zeros(n, np.int64)
        """(n,) seeds of the noise in the images."""

    def place(self, row: int, plan: Plan, degradation: float, rng: np.random.Generator) -> None:
        """Put a course around a car, see `Vision`; the generator gives the seed of its images' noise."""
        self.image_seeds[row] = rng.integers(2**32)
        self.vision.place(row, plan, degradation, int(self.image_seeds[row]))

    def reset(self, rows: Index) -> None:
        """Forget what cars (k,) saw, and let them look."""
        self.exposures[rows] = 0
        for row in rows.tolist():
            rate = float(self._parameters.drawn["false_sighting_rate"][row])
            self._false_sightings.reset(row, rate, int(self.image_seeds[row]))
        self._pipeline.reset(rows, self._parameters.drawn["camera_latency_s"][rows])
        self.update(rows)

    def update(self, moving: Index) -> None:
        """Expose the images that are due in the cars (k,) that move, and deliver those that have arrived."""
        time_s = self._physics.time_s
        rows = self._pipeline.trigger(moving, time_s)
        if len(rows):
            seen = self.vision.see(rows, self._truth.pose[rows], self._physics.qpos[rows], self.mounting(rows))
            self._false_sightings.add(rows, seen)
            self._pipeline.expose(rows, time_s, seen)
            self.exposures[rows] += 1
        self._pipeline.deliver(time_s)

    def mounting(self, rows: Index) -> Array:
        """(k, 3) roll, pitch, yaw of the cameras' mounting errors, rad."""
        degrees = [self._parameters.drawn[f"camera_{axis}_deg"][rows] for axis in ("roll", "pitch", "yaw")]
        return np.radians(np.stack(degrees, axis=1))

    def readings(self) -> dict[str, Array]:
        """``gate_id`` .. ``marker_age``, (n,) each."""
        return self._pipeline.readings(self._physics.time_s)
