"""The ultrasonics of n cars: rays that MuJoCo casts in their cadence, made into ranges."""

from __future__ import annotations

import math

import numpy as np

from tral_env.arrays import ALONE, Array, Index, everyone, plain
from tral_env.config import UltrasonicConfig
from tral_env.noise import NoiseTape
from tral_env.se2 import rotate
from tral_env.sensors import ultrasonic
from tral_env.sensors.ranging import BORESIGHT, SONARS, Ranging
from tral_env.simulation.parameters import CarParameters
from tral_env.simulation.physics import Physics
from tral_env.simulation.truth import GroundTruth

_DRAWS = 2 + ultrasonic.MEASURE_DRAWS
"""Number of draws for one ranging: softness of the incidence limit, crosstalk, measurement."""


class Sonars:
    """Fires each sonar when MuJoCo has cast its rays."""

    def __init__(
        self,
        n: int,
        config: UltrasonicConfig,
        physics: Physics,
        truth: GroundTruth,
        parameters: CarParameters,
        noise: NoiseTape,
    ) -> None:
        """Nothing measured yet."""
        self._config, self._physics, self._truth = config, physics, truth
        self._parameters, self._noise = parameters, noise
        self.ranging = Ranging(n)
        self._last_fired = np.zeros((n, len(SONARS)))
        self._everyone = everyone(n)
        self._yaw_rate = physics.qvel[:, physics.handles.root_dof + 5]
        self._clocks = [physics.history[:, clock] for clock in physics.handles.sonar_clocks.tolist()]

    def reset(self, rows: Index) -> None:
        """Range once at time 0; then the sonars of cars (k,) fire in turn, or together, each in its cadence."""
        drawn, count = self._parameters.drawn, len(SONARS)
        row, sonar = np.repeat(rows, count), np.tile(np.arange(count), len(rows))
        self.ranging.reset(rows, self._measure(row, sonar, np.zeros(len(row))).reshape(-1, count))
        cadence = drawn["sonar_cadence_s"][rows, None]
        together = drawn["sonar_together"][rows, None] > 0.5
        wait = np.where(together, 1.0, (np.arange(count) + 1.0) / count) * cadence
        for k in range(count):
            self._physics.history[rows[:, None], self._physics.handles.ray_clocks[k]] = (wait - cadence)[:, k, None]
        self._last_fired[rows] = wait - cadence

    def update(self) -> None:
        """Take over the rays that were cast since the last call."""
        if self._everyone is ALONE:
            self._update_alone()
            return
        physics, last = self._physics, self._last_fired
        if not any((clock > last[:, k]).any() for k, clock in enumerate(self._clocks)):
            return
        fired_at = physics.history[:, physics.handles.sonar_clocks]
        rows, sonars = np.nonzero(fired_at > last)
        time_s = fired_at[rows, sonars]
        last[rows, sonars] = time_s
        self.ranging.fire(rows, sonars, self._measure(rows, sonars, physics.time_s[rows] - time_s), time_s)

    def _update_alone(self) -> None:
        """`update` of a car alone, sonar by sonar."""
        last = self._last_fired[ALONE].tolist()
        clocks = [clock.item(ALONE) for clock in self._clocks]
        fired = [(k, now) for k, (now, before) in enumerate(zip(clocks, last, strict=True)) if now > before]
        if not fired:
            return
        drawn, config = self._parameters.drawn, self._config
        uniform = self._noise.uniform(ALONE, _DRAWS * len(SONARS)).reshape(len(SONARS), _DRAWS).tolist()
        echoes = [math.inf] * len(SONARS)
        for k, time_s in fired:
            self._last_fired[ALONE, k] = time_s
            echoes[k] = self._echo_alone(k, time_s, uniform[k][0])
        if (together := drawn["sonar_together"] > 0.5).any():
            heard = np.array(echoes)[:, None], np.array(uniform)[:, 1:2]
            echoes = ultrasonic.crosstalk(*heard, together, config)[:, ALONE].tolist()
        outlier_rate = drawn["sonar_outlier_rate"].item(ALONE)
        for k, time_s in fired:
            range_m = ultrasonic.measure(echoes[k], uniform[k][2:], config, outlier_rate)
            self.ranging.fire(ALONE, k, range_m, time_s)

    def _echo_alone(self, sonar: int, time_s: float, softness: float) -> float:
        """First echo of a sonar of a car alone, m, which fired at a time, s."""
        physics = self._physics
        since_s = physics.time_s.item(ALONE) - time_s
        angle = self._truth.pose.item(ALONE, 2) - self._yaw_rate.item(ALONE) * since_s + BORESIGHT.item(sonar)
        cos, sin = plain(np.cos(-angle)), plain(np.sin(-angle))
        fan = physics.sensordata[ALONE].take(physics.handles.fans[sonar]).reshape(-1, 4).tolist()
        rays = ((reach, *rotate(cos, sin, nx, ny)) for reach, nx, ny, _ in fan)
        return ultrasonic.echo_alone(rays, self._config, softness)

    def _measure(self, rows: Index, sonars: Index, since_s: Array) -> Array:
        """Ranges (k,) of the named sonars, m, from rays that were cast `since_s` ago. Rows ascend, and may repeat."""
        config, drawn = self._config, self._parameters.drawn
        distance, normal = self._echo_points(rows, sonars, since_s)
        first = np.append(True, rows[1:] != rows[:-1])
        row, place = rows[first], first.cumsum() - 1
        # A row takes the numbers of all its sonars at once, whichever fired.
        uniform = self._noise.uniform(row, _DRAWS * len(SONARS)).reshape(len(row), len(SONARS), _DRAWS)
        own = uniform[place, sonars]
        echoes = np.full((len(SONARS), len(row)), np.inf)
        echoes[sonars, place] = ultrasonic.echo(distance, normal, config, own[:, 0])
        if (together := drawn["sonar_together"][row] > 0.5).any():
            echoes = ultrasonic.crosstalk(echoes, uniform[:, :, 1].T, together, config)
        ranges: Array = ultrasonic.measure(echoes[sonars, place], own[:, 2:], config, drawn["sonar_outlier_rate"][rows])
        return ranges

    def _echo_points(self, rows: Index, sonars: Index, since_s: Array) -> tuple[Array, Array]:
        """Length of each ray (k, R), m, and the normal of what it hit (k, R, 2), in the sonar's frame when it fired."""
        physics = self._physics
        # Taking from a flat array costs half of indexing by row and column.
        at = rows[:, None] * physics.sensordata.shape[1] + physics.handles.fans[sonars]
        fan = physics.sensordata.reshape(-1).take(at).reshape(len(rows), self._config.rays, 4)
        angle = self._truth.pose[rows, 2] - self._yaw_rate[rows] * since_s + BORESIGHT[sonars]
        return fan[..., 0], _turned(fan, angle[:, None])

    def readings(self) -> dict[str, Array]:
        """``ultrasonic_left`` .. ``ultrasonic_right_age``, (n,) each."""
        return self.ranging.readings(self._physics.time_s)


def _turned(fan: Array, angle: Array) -> Array:
    """The normals in the columns 1 and 2 of rays (..., R, 4), (..., R, 2) as a sonar sees them that looks so, rad."""
    normal = np.empty((*fan.shape[:-1], 2))
    normal[..., 0], normal[..., 1] = rotate(np.cos(-angle), np.sin(-angle), fan[..., 1], fan[..., 2])
    return normal
