"""The optional groups of readings: line, inertial, battery. A group that was not asked for costs nothing."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import ALL, ALONE, Array, Rows
from tral_env.config import ImuConfig, LineConfig
from tral_env.interface import OPTIONAL_GROUPS, Layout
from tral_env.noise import NoiseTape
from tral_env.sensors.imu import AXES, draw_bias, measure
from tral_env.sensors.line import line_byte


class OptionalReadings:
    """Readings of the optional groups of n cars."""

    def __init__(self, n: int, layout: Layout, noise: NoiseTape) -> None:
        """Prepare the groups that the layout names.

        Args:
            n: number of cars.
            layout: fields of the observation.
            noise: tapes of the cars.
        """
        self.groups = {name for name, fields in OPTIONAL_GROUPS.items() if fields[0].name in layout.names}
        """Names of the groups that are measured."""
        self._noise, self._line, self._imu = noise, LineConfig(), ImuConfig()
        self._tape = np.zeros((n, 0, 4))
        self._bias = np.zeros((n, AXES))
        self._values = {name: np.zeros(n) for name in layout.names if name not in Layout().names}

    def place(self, row: int, tape: Array) -> None:
        """Put a car on a new course and draw the bias of its inertial sensor; call it after the reset of the noise.

        Args:
            row: the car.
            tape: (T, 4) tape on the floor: x0, y0, x1, y1 of its middle line, m.
        """
        more = len(tape) - self._tape.shape[1]
        if more > 0:
            self._tape = np.pad(self._tape, ((0, 0), (0, more), (0, 0)))
        self._tape[row] = 0.0
        self._tape[row, : len(tape)] = tape
        if "imu" in self.groups:
            self._bias[row] = draw_bias(self._noise.normal(np.array([row]), AXES)[0], self._imu)

    def update(self, rows: Rows, pose: Array, motion: Array, battery_v: Array) -> None:
        """Measure what the groups need.

        Args:
            rows: the cars that moved, k.
            pose: (n, 3) x, y, yaw, m and rad.
            motion: (n, 6) angular rate, rad/s, and proper acceleration, m/s^2, in the car's frame.
            battery_v: (k,) voltages of their batteries under load, V.
        """
        rows = ALL if rows is ALONE else rows
        if "line" in self.groups:
            self._values["line"][rows] = line_byte(pose[rows], self._tape[rows], self._line)
        if "imu" in self.groups:
            read = measure(motion[rows], self._bias[rows], self._noise.normal(rows, AXES), self._imu)
            for i, field in enumerate(OPTIONAL_GROUPS["imu"]):
                self._values[field.name][rows] = read[:, i]
        if "battery" in self.groups:
            self._values["battery"][rows] = battery_v

    def readings(self) -> dict[str, Array]:
        """Last readings of all cars by the name of the field, (n,) each."""
        return self._values
