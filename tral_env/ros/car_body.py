"""The real car as the body of the car node: `TralCar-v0`, whose actuator process stays the only owner of the board."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tral_env.hardware.env import TralCarEnv
from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT
from tral_env.ros.body import Tick
from tral_env.ros.readings import Told

FOR_EVER_S = 1e9
"""`max_duration_s` of an environment that a node drives."""


class CarBody:
    """Drives the environment of the real car."""

    sim_time_s = None

    def __init__(
        self,
        env: TralCarEnv,
        name: str,
        *,
        sees: bool,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Take over an open environment.

        Args:
            env: the car.
            name: which car this is.
            sees: whether its sensors have a camera.
            clock: gives a time that never goes back, s.
            sleep: waits some seconds.
        """
        self.env, self.name, self.sees = env, name, sees
        self._clock, self._sleep = clock, sleep
        self._started = False

    def arm(self) -> Tick:
        """See `Body.arm`; it takes as long as the motor controller wants to see neutral."""
        observation, _ = self.env.reset()
        self._started = True
        return Tick(self._named(observation))

    def step(self, steering: float, throttle: float) -> Tick:
        """See `Body.step`."""
        observation, _, _, truncated, _ = self.env.step(np.array([steering, throttle], np.float32))
        return Tick(self._named(observation), "time limit" if truncated else "")

    def rest(self) -> Tick:
        """See `Body.rest`; the sensors are read, and a sensor that fails reads nothing."""
        began_s = self._clock()
        readings: Mapping[str, float] = {}
        sensors = self.env.sensors
        if sensors is not None:
            try:
                if not self._started:
                    self._started = True
                    sensors.start()
                readings = sensors.read(self._clock())
            except OSError:  # of a driver, or a HardwareError, which is one too
                readings = {}
        self._sleep(max(began_s + CONTROL_PERIOD_S - self._clock(), 0.0))
        return Tick({**readings, "steering": 0.0, "throttle": 0.0})

    def stop(self) -> None:
        """See `Body.stop`."""
        self.env.stop()

    def reset(self, seed: int) -> None:
        """See `Body.reset`: nothing."""

    def extra(self, now_ns: int) -> Sequence[Told]:
        """See `Body.extra`: nothing."""
        del now_ns
        return ()

    def latched(self, now_ns: int) -> Sequence[Told]:
        """See `Body.latched`: nothing."""
        del now_ns
        return ()

    def close(self) -> None:
        """See `Body.close`."""
        self.env.close()

    def _named(self, observation: NDArray[np.float32]) -> dict[str, float]:
        applied = {name: float(observation[CORE_LAYOUT.column(name)]) for name in ("steering", "throttle")}
        return {**self.env.readings, **applied}
