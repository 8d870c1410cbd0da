"""The wheel that n cars' hall sensors count."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Index, Rows, Values, everyone, pick
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
        self._everyone = everyone(n)
        self._turned = physics.sensordata[:, physics.handles.hall_wheel]

    def reset(self, rows: Index) -> None:
        """Begin to count anew from where the wheels of cars (k,) stand."""
        self.hall.reset(rows)
        self._angle[rows] = self._turned[rows]

    def update(self, moving: Rows) -> None:
        """Count the ticks of a control period; only the cars (k,) that move draw noise."""
        drawn, rows = self._parameters.drawn, self._everyone
        angle = pick(self._turned, rows)
        travel = (angle - pick(self._angle, rows)) * self._car.wheel_radius / pick(drawn["wheel_radius_scale"], rows)
        self._angle[rows] = angle
        uniform = self._noise.uniform(moving, UPDATE_DRAWS)
        if moving is not rows:
            uniform, drawing = np.zeros((self._n, UPDATE_DRAWS)), uniform
            uniform[moving] = drawing
        rates = drawn["hall_miss_rate"], drawn["hall_double_rate"]
        self.hall.update(travel, self._physics.time_s, CONTROL_PERIOD_S, uniform, *rates)

    def readings(self) -> dict[str, Values]:
        """``distance`` and ``speed``, see `Hall.readings`."""
        return self.hall.readings()
