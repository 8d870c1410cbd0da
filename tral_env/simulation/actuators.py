"""From the commands of n cars to the servos and motors of their models."""

from __future__ import annotations

import numpy as np

from tral_env.actuation import Actuation
from tral_env.arrays import ALONE, Array, Index, Rows, columns, maximum, minimum, pick
from tral_env.config import CarConfig
from tral_env.simulation.physics import Physics

STEERING_LEAD_STEPS = 0.8
"""The semi-implicit integrator turns the car this many of its steps too early, so the servo is held back as much.

Source: measured against steps of 0.25 ms in tests/car; it halves the error of the position and leaves a third of the
error of the heading.
"""


class Actuators:
    """The last commands, the actuation that follows them, and the model's actuators that obey it."""

    def __init__(self, n: int, car: CarConfig, physics: Physics) -> None:
        """Stand still."""
        self._physics, self._car = physics, car
        self.actuation = Actuation(n, car=car, lead_s=STEERING_LEAD_STEPS * physics.model.opt.timestep)
        self.command = np.zeros((n, 2))
        """(n, 2) last command, as applied."""
        self._wheel_rates = [physics.sensordata[:, wheel] for wheel in physics.handles.wheel_speeds.tolist()]

    def reset(self, rows: Index) -> None:
        """Let cars (k,) stand still."""
        self.command[rows] = 0.0
        self.actuation.reset(rows)

    def apply(self, moving: Rows, command: Array) -> Array:
        """Let the actuators of cars follow their commands for a tick.

        Args:
            moving: (k,) the cars that move.
            command: (n, 2) steering, throttle; clipped to [-1, 1].

        Returns:
            (k,) voltages of their batteries under load, V, or a number of a car alone.
        """
        applied, physics, handles = self.command, self._physics, self._physics.handles
        for i, value in enumerate(columns(command, moving)):
            applied[moving, i] = minimum(maximum(value, -1.0), 1.0)
        wanted = applied[moving]
        drive = self.actuation.apply(moving, wanted.tolist() if moving is ALONE else wanted, self._wheel_speed(moving))
        physics.ctrl[moving, handles.steer_actuator] = drive.steering_angle
        physics.ctrl[moving, handles.drive_actuator] = drive.voltage
        physics.frictionloss[moving, handles.steer_dof] = drive.scrub_torque
        return drive.battery_v

    def _wheel_speed(self, moving: Rows) -> Array:
        """(k,) mean rate of the four wheels times their radius, m/s; a sum in fixed order, alike for any n."""
        a, b, c, d = (pick(rate, moving) for rate in self._wheel_rates)
        speed: Array = (a + b + c + d) * (self._car.wheel_radius / 4)
        return speed
