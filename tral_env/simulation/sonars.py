"""The ultrasonics of n cars: rays that MuJoCo casts in their cadence, made into ranges."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Array, Index, columns, everyone, is_any, pick
from tral_env.config import UltrasonicConfig
from tral_env.noise import NoiseTape
from tral_env.se2 import rotate_n
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
        physics, last = self._physics, columns(self._last_fired, self._everyone)
        cast = (pick(clock, self._everyone) > before for clock, before in zip(self._clocks, last, strict=True))
        if not any(map(is_any, cast)):
            return
        fired_at = physics.history[:, physics.handles.sonar_clocks]
        rows, sonars = np.nonzero(fired_at > self._last_fired)
        time_s = fired_at[rows, sonars]
        self._last_fired[rows, sonars] = time_s
        self.ranging.fire(rows, sonars, self._measure(rows, sonars, physics.time_s[rows] - time_s), time_s)

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
        return ultrasonic.measure(echoes[sonars, place], own[:, 2:], config, drawn["sonar_outlier_rate"][rows])

    def _echo_points(self, rows: Index, sonars: Index, since_s: Array) -> tuple[Array, Array]:
        """Length of each ray (k, R), m, and the normal of what it hit (k, R, 2), in the sonar's frame when it fired."""
        physics, handles = self._physics, self._physics.handles
        fan = physics.sensordata[rows[:, None], handles.fans[sonars]].reshape(len(rows), self._config.rays, 4)
        yaw_rate = physics.qvel[rows, handles.root_dof + 5]
        angle = self._truth.pose[rows, 2] - yaw_rate * since_s + BORESIGHT[sonars]
        return fan[..., 0], rotate_n(-angle[:, None], fan[..., 1:3])

    def readings(self) -> dict[str, Array]:
        """``ultrasonic_left`` .. ``ultrasonic_right_age``, (n,) each."""
        return self.ranging.readings(self._physics.time_s)
