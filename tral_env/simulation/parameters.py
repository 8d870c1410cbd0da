"""The drawn parameters of n cars, and their way into physics and actuation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from tral_env.actuation import Actuation
from tral_env.arrays import Array, Index
from tral_env.randomization import PARAMETERS
from tral_env.sensors.ranging import SONARS
from tral_env.simulation.physics import Physics

_ACTUATION = ("lock_scale", "servo_speed_scale", "servo_strength_scale", "latency_s", "battery_v")
"""Parameters that the actuation takes as they were drawn, under the same name."""


class CarParameters:
    """What `Randomization` drew for n cars."""

    def __init__(self, n: int, physics: Physics, actuation: Actuation) -> None:
        """Nothing drawn yet."""
        self._physics, self._actuation = physics, actuation
        self.drawn: dict[str, Array] = {name: np.zeros(n) for name in PARAMETERS}
        """Each of `PARAMETERS` by name, (n,); 0 before the first draw."""

    def apply(self, rows: Index, cars: Sequence[Mapping[str, float]]) -> None:
        """Give cars (k,) the bodies, tyres, sonars and actuators of k draws; before the physics' `reset`."""
        for name in cars[0]:
            self.drawn[name][rows] = [car[name] for car in cars]
        drawn = {name: values[rows] for name, values in self.drawn.items()}
        self._apply_to_physics(rows, drawn)
        self._apply_to_actuation(rows, drawn)

    def _apply_to_physics(self, rows: Index, drawn: Mapping[str, Array]) -> None:
        physics, model, handles = self._physics, self._physics.model, self._physics.handles
        bodies = handles.car_bodies
        physics.mass[rows[:, None], bodies] = model.body_mass[bodies] * drawn["mass_scale"][:, None]
        physics.inertia[rows[:, None], bodies] = model.body_inertia[bodies] * drawn["mass_scale"][:, None, None]
        physics.geom["geom_friction"][rows[:, None], handles.tyres, 0] = drawn["friction"][:, None]
        for sonar in range(len(SONARS)):
            physics.sensor_interval[rows[:, None], handles.rays[sonar], 0] = drawn["sonar_cadence_s"][:, None]

    def _apply_to_actuation(self, rows: Index, drawn: Mapping[str, Array]) -> None:
        parameters = self._actuation.parameters
        parameters.mechanism_offset[rows] = np.radians(drawn["mechanism_offset_deg"])
        parameters.steering_offset[rows] = np.radians(drawn["steering_offset_deg"])
        for name in _ACTUATION:
            getattr(parameters, name)[rows] = drawn[name]
        parameters.battery_resistance[rows] = drawn["battery_resistance_ohm"]
