"""The real car as the body of the car node: `TralCar-v0`, whose actuator process stays the only owner of the board."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from tral_env.config import CarConfig
from tral_env.errors import ActuatorLostError, HardwareError
from tral_env.hardware.env import TralCarEnv
from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT
from tral_env.ros.body import Tick
from tral_env.ros.readings import Told

FOR_EVER_S = 1e9
"""`max_duration_s` of an environment that a node drives."""


class CarBody:
    """Drives the environment of the real car.

    When the actuator's process is gone, because its worker died or its keeper had to end the pulses, the car stands
    without pulses. Then the next arming opens the car anew. A new process is refused while an old one still tries to
    end the pulses.
    """

    sim_time_s = None

    def __init__(
        self,
        open_car: Callable[[], TralCarEnv],
        name: str,
        *,
        sees: bool,
        camera_x: float = CarConfig.camera_x,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Open the car.

        Args:
            open_car: opens its environment, which is closed again by this body.
            name: which car this is.
            sees: whether its sensors have a camera.
            camera_x: the camera stands this far ahead of the rear axle, m.
            clock: gives a time that never goes back, s.
            sleep: waits some seconds.

        Raises:
            ConfigError: the car cannot be opened as it is described.
            HardwareError: a device does not answer.
        """
        self._open_car = open_car
        self.env: TralCarEnv | None = open_car()
        """None: its actuator's process is gone, and it could not be opened anew yet."""
        self.name, self.sees, self.camera_x = name, sees, camera_x
        self._clock, self._sleep = clock, sleep
        self._started = False

    def arm(self) -> Tick:
        """See `Body.arm`; it takes as long as the motor controller wants to see neutral."""
        if self.env is None:
            self.env = self._open_car()
        try:
            observation, _ = self.env.reset()
        except ActuatorLostError:
            observation, _ = self._opened_anew().reset()
        self._started = True
        return Tick(self._named(observation))

    def step(self, steering: float, throttle: float) -> Tick:
        """See `Body.step`."""
        if self.env is None:
            raise HardwareError("the car is not open")
        try:
            observation, _, _, truncated, _ = self.env.step(np.array([steering, throttle], np.float32))
        except ActuatorLostError as error:
            raise HardwareError(f"{error}: true on the topic arm does that") from error
        return Tick(self._named(observation), "time limit" if truncated else "")

    def rest(self) -> Tick:
        """See `Body.rest`; the sensors are read, and where one fails, nothing is."""
        began_s, trouble = self._clock(), ""
        readings: Mapping[str, float] = {}
        sensors = None if self.env is None else self.env.sensors
        if sensors is not None:
            try:
                if not self._started:
                    sensors.start()
                    self._started = True
                readings = sensors.read(self._clock())
            except OSError as error:  # of a driver, or a HardwareError, which is one too
                trouble = str(error)
        self._sleep(max(began_s + CONTROL_PERIOD_S - self._clock(), 0.0))
        return Tick({**readings, "steering": 0.0, "throttle": 0.0}, trouble=trouble)

    def stop(self) -> None:
        """See `Body.stop`; where the actuator's process is gone, its keeper has stopped the car."""
        if self.env is not None:
            with suppress(ActuatorLostError):
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
        if self.env is not None:
            self.env.close()

    def _opened_anew(self) -> TralCarEnv:
        """The car with another process of its actuator.

        Raises:
            HardwareError: it cannot be opened; the next arming tries again.
        """
        lost, self.env = self.env, None
        self._started = False
        if lost is not None:
            with suppress(HardwareError, OSError):  # an old process that lives yet keeps the new one from the board
                lost.close()
        self.env = self._open_car()
        return self.env

    def _named(self, observation: NDArray[np.float32]) -> dict[str, float]:
        applied = {name: float(observation[CORE_LAYOUT.column(name)]) for name in ("steering", "throttle")}
        return {**({} if self.env is None else self.env.readings), **applied}
