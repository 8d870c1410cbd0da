"""The twin as the body of the car node: the environment of the real car, at the twin's device files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tral_env.errors import HardwareError
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.env import TralCarEnv
from tral_env.hardware.sensors import SensorGroup
from tral_env.hardware.sonar import SonarArray
from tral_env.ros import topics
from tral_env.ros.body import Tick
from tral_env.ros.car_body import FOR_EVER_S, CarBody
from tral_env.ros.msg.std import String
from tral_env.ros.readings import Told
from tral_env.twin.hall import TwinHall
from tral_env.twin.running import TwinProcess
from tral_env.twin.settings import TwinSettings

_LOOK_TICKS = 20
"""The twin is asked this seldom how its drive goes."""


class TwinBody(CarBody):
    """A twin in a process of its own, and the program of the real car that drives it."""

    def __init__(self, settings: TwinSettings) -> None:
        """Start the twin, and open the car at it.

        Raises:
            HardwareError: the twin does not start, or has no files here.
        """
        self._twin = TwinProcess(settings)
        self._status = self._twin.first_status
        self._seed, self._ticks, self._told = settings.seed, 0, False
        self._fresh = True
        self._outcome: dict[str, Any] | None = None
        """How this drive ended; None: it goes on."""
        if self._status["i2c"] is None:
            self._twin.close()
            raise HardwareError(f"the twin has no device files here: {self._status['why_no_files']}")
        try:
            super().__init__(self._open, "twin", sees=False)
        except BaseException:
            self._twin.close()
            raise

    def arm(self) -> Tick:
        """See `Body.arm`; a drive that is over, or has not begun, begins at the start, after the second of neutral."""
        tick = super().arm()
        if self._fresh or self._told:
            self.reset(self._seed)
            self._fresh = False
        return tick

    def reset(self, seed: int) -> None:
        """See `Body.reset`."""
        self._twin.reset(seed)
        self._seed, self._fresh, self._told, self._outcome = seed, True, False, None

    def step(self, steering: float, throttle: float) -> Tick:
        """See `Body.step`."""
        return self._looked_at(super().step(steering, throttle))

    def rest(self) -> Tick:
        """See `Body.rest`."""
        return self._looked_at(super().rest())

    def extra(self, now_ns: int) -> Sequence[Told]:
        """See `Body.extra`: how the drive has ended."""
        if self._told or self._outcome is None:
            return ()
        self._told = True
        success = self._outcome["ended"] == "success"
        told = {"seed": self._seed, "success": success, **self._outcome, "lateness": self._twin.status()["lateness"]}
        return (Told(topics.RESULT, String(json.dumps(told))),)

    def latched(self, now_ns: int) -> Sequence[Told]:
        """See `Body.latched`: where its camera is."""
        url = self._status["camera"]
        return () if url is None else (Told(topics.CAMERA_URL, String(url)),)

    def close(self) -> None:
        """See `Body.close`."""
        try:
            super().close()
        finally:
            self._twin.close()

    def _looked_at(self, tick: Tick) -> Tick:
        """A tick of a drive; now and then the twin is asked how that goes."""
        self._ticks += 1
        if self._outcome is None and not self._fresh and self._ticks % _LOOK_TICKS == 0:
            self._outcome = self._twin.outcome()
        return tick if self._outcome is None else tick._replace(over=self._outcome["ended"])

    def _open(self) -> TralCarEnv:
        """The car's own environment, with a calibration that knows the clock of the twin's board."""
        bus, clock_hz = self._status["i2c"], float(self._status["oscillator_hz"])
        calibration = load_calibration("tt01").model_copy(update={"oscillator_hz": clock_hz, "clock_measured": True})
        return TralCarEnv(
            calibration=calibration,
            output="pca9685",
            sensors=SensorGroup(SonarArray(bus=bus), TwinHall(Path(self._status["hall"]))),
            bus=bus,
            max_duration_s=FOR_EVER_S,
        )
