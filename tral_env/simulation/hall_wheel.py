"""The wheel that n cars' hall sensors count."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Array, Index
from tral_env.config import CarConfig, HallConfig
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.noise import NoiseTape
from tral_env.sensors.hall import UPDATE_DRAWS, Hall
from tral_env.simulation.parameters import CarParameters
from tral_env.simulation.physics import Physics


class HallWheel:
    """Turns the wheels' angles into travel, and the travel into ticks."""

    def __init__(self, n: int, car: CarConfig, physics: Physics, parameters: CarParameters, noise: NoiseTape) -> None:
        """Nothing counted yet."""
        self._n, self._car, self._physics, self._parameters, self._noise = n, car, physics, parameters, noise
        self.hall = Hall(n, HallConfig())
        self._angle = np.zeros(n)

    def reset(self, rows: Index) -> None:
        """Begin to count anew from where the wheels of cars (k,) stand."""
        self.hall.reset(rows)
        self._angle[rows] = self._physics.sensordata[rows, self._physics.handles.hall_wheel]

    def update(self, moving: Index) -> None:
        """Count the ticks of a control period; only the cars (k,) that move draw noise."""
        drawn = self._parameters.drawn
        angle = self._physics.sensordata[:, self._physics.handles.hall_wheel]
        travel = (angle - self._angle) * self._car.wheel_radius / drawn["wheel_radius_scale"]
        self._angle[:] = angle
        uniform = np.zeros((self._n, UPDATE_DRAWS))
        uniform[moving] = self._noise.uniform(moving, UPDATE_DRAWS)
        rates = drawn["hall_miss_rate"], drawn["hall_double_rate"]
        self.hall.update(travel, self._physics.time_s, CONTROL_PERIOD_S, uniform, *rates)

    def readings(self) -> dict[str, Array]:
        """``distance`` and ``speed``, (n,) each."""
        return {"distance": self.hall.distance, "speed": self.hall.speed}
