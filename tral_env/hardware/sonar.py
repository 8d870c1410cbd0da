"""Three ultrasonic rangers SRF08 or SRF02 on the I2C bus. Source of registers and commands: their data sheets."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping

from tral_env.config import UltrasonicConfig
from tral_env.errors import ConfigError, HardwareError
from tral_env.hardware.i2c import Bus, BusName, Device, Smbus
from tral_env.hardware.physical import Physical
from tral_env.hardware.sensors import FrameWatcher
from tral_env.interface import NO_ECHO_M
from tral_env.sensors.ultrasonic import limits, readable, resolution

ADDRESSES: Mapping[str, int] = {"left": 0x70, "front": 0x71, "right": 0x72}
"""Each ranger answers to this address, 7 bit."""

_BROADCAST = 0x00
"""All rangers take what is written to this address, the I2C bus's general call."""
_COMMAND = 0
"""Register of the command when written, of the version when read."""
_GAIN = 1
"""Register of the greatest analogue gain."""
_RANGE = 2
"""Register of the time for which the ranger listens, when written."""
_FIRST_ECHO = 2
"""Register of the first echo, high byte first, when read."""
_REPLY: Mapping[str, int] = {"cm": 0x51, "us": 0x52}
"""Commands that fire, by the unit of the reply."""
_BUSY = 0xFF
"""The version register reads so while the ranger listens."""
_MAX_GAIN = 31
_RANGE_STEP_M = 0.043
"""The ranger listens for (register + 1) times this range."""
_MAX_RANGE_M = 256 * _RANGE_STEP_M
"""The register is a byte: a ranger listens for no more than this range."""
_PATIENCE_S = 0.3
"""A ranger that is busy for longer counts as broken."""
_START_ATTEMPTS = 10
"""A ranger is asked so often, a quarter of the cadence apart, to finish a ranging and start anew."""


class Srf08(Physical):
    """One ranger SRF08: its registers, without any notion of time."""

    model = "SRF08"
    hears_all = True
    """Whether it also takes what is written to the address of all."""

    def __init__(self, device: Device, config: UltrasonicConfig) -> None:
        """Name a ranger; nothing is sent yet."""
        self._device, self._config = device, config

    def configure(self) -> None:
        """Set full gain, and let the ranger listen no longer than the maximum range takes.

        Raises:
            HardwareError: no answer, or not an SRF08.
        """
        if self.busy():
            raise self._device.nonsense("busy")
        self._device.write(_GAIN, _MAX_GAIN)
        self._device.write(_RANGE, math.ceil(limits(self._config)[1] / _RANGE_STEP_M) - 1)

    def fire(self) -> None:
        """Begin a ranging."""
        self._device.write(_COMMAND, _REPLY[self._config.mode])

    def busy(self) -> bool:
        """Whether it is still listening: it does not drive the bus then, which reads as version 0xFF."""
        return self._device.read(_COMMAND)[0] == _BUSY

    def first_echo(self) -> bytes:
        """Registers of the first echo."""
        return bytes(self._device.read(_FIRST_ECHO, 2))

    def range_m(self, echo: bytes) -> float:
        """Range of a first echo, m; `NO_ECHO_M` without one."""
        high, low = echo
        metres = resolution(self._config) * (high << 8 | low)
        return metres if readable(metres, self._config) else NO_ECHO_M


class Srf02(Srf08):
    """One ranger SRF02: it chooses gain and range by itself, and hears only its own address."""

    model = "SRF02"
    hears_all = False

    def configure(self) -> None:
        """Find out whether it answers.

        Raises:
            HardwareError: no answer.
        """
        if self.busy():
            raise self._device.nonsense("busy")


class SonarArray(Physical):
    """The three rangers as `Sensors`: it fires them again and again, reads them when ready, and never waits."""

    def __init__(
        self,
        bus: BusName | Smbus = 1,
        config: UltrasonicConfig | None = None,
        addresses: Mapping[str, int] = ADDRESSES,
        firing: str = "together",
        sleep: Callable[[float], None] = time.sleep,
        ranger: type[Srf08] = Srf08,
    ) -> None:
        """Open the bus; nothing is sent yet.

        Args:
            bus: see `Bus`.
            config: mode, cadence, range and scale.
            addresses: side -> address, 7 bit.
            firing: "together", each at the full cadence, as the cars of 2016 did; or "in turn", one each cadence, which
                is three times slower and without crosstalk.
            sleep: waits some seconds; only `start` uses it.
            ranger: `Srf08` or `Srf02`.

        Raises:
            ConfigError: a side or a firing that does not exist, or a range that no SRF08 has.
            MissingExtraError: smbus2 is not installed.
            HardwareError: the bus cannot be opened.
        """
        if firing not in ("together", "in turn") or not addresses or not set(addresses) <= set(ADDRESSES):
            raise ConfigError(
                f"firing = {firing!r}, addresses = {dict(addresses)}. "
                "Allowed: together, in turn; addresses of left, front, right"
            )
        self._config = config or UltrasonicConfig()
        _, farthest = limits(self._config)
        if farthest > _MAX_RANGE_M:
            raise ConfigError(
                f"UltrasonicConfig of mode '{self._config.mode}' with a range of {farthest:g} m: an SRF08 listens for "
                f"{_MAX_RANGE_M:g} m at most"
            )
        self._bus = Bus(bus)
        self._broadcast = ranger(self._bus.device(_BROADCAST, "ultrasonics, all together,"), self._config)
        self._rangers = {
            side: ranger(self._bus.device(address, f"{side} ultrasonic {ranger.model}"), self._config)
            for side, address in addresses.items()
        }
        self._together, self._sleep = firing == "together", sleep
        self._watcher: FrameWatcher | None = None
        self._forget()

    @property
    def provided_readings(self) -> frozenset[str]:
        """Names of the ranges and ages of the rangers."""
        return frozenset(f"ultrasonic_{side}{what}" for side in self._rangers for what in ("", "_age"))

    def watch_frames(self, watcher: FrameWatcher) -> None:
        """Call a watcher with the two registers of each first echo that is read."""
        self._watcher = watcher

    def start(self) -> None:
        """Configure each ranger, which may have to finish a ranging first, and forget all readings."""
        self._forget()
        for ranger in self._rangers.values():
            for attempt in range(_START_ATTEMPTS):
                try:
                    ranger.configure()
                    break
                except HardwareError:
                    if attempt == _START_ATTEMPTS - 1:
                        raise
                    self._sleep(self._config.cadence_s / 4)

    def read(self, now: float) -> Mapping[str, float]:
        """Give the latest ranges and their ages since firing; see `Sensors.read`."""
        self._collect(now)
        if not self._listening and now - self._fired >= self._config.cadence_s:
            self._try_to_fire(now)
        readings: dict[str, float] = {}
        for side, (metres, fired) in self._latest.items():
            readings[f"ultrasonic_{side}"] = metres
            readings[f"ultrasonic_{side}_age"] = now - fired
        return readings

    def stop(self) -> None:
        """Let go of the bus."""
        self._bus.close()

    def _forget(self) -> None:
        self._latest: dict[str, tuple[float, float]] = {}
        self._listening: set[str] = set()
        self._fired = -math.inf
        self._unfired: float | None = None
        """Firing has failed since then."""
        self._turn = 0

    def _try_to_fire(self, now: float) -> None:
        """Fire; a firing that fails is nothing new, and is tried again at the next reading."""
        try:
            self._fire(now)
        except HardwareError:
            self._unfired = now if self._unfired is None else self._unfired
            if now - self._unfired > _PATIENCE_S:
                raise
        else:
            self._unfired = None

    def _fire(self, now: float) -> None:
        sides = tuple(self._rangers)
        if self._together:
            for each in [self._broadcast] if self._broadcast.hears_all else self._rangers.values():
                each.fire()
            self._listening = set(sides)
        else:
            side = sides[self._turn % len(sides)]
            self._rangers[side].fire()
            self._listening = {side}
            self._turn += 1
        self._fired = now

    def _collect(self, now: float) -> None:
        """Read the rangers that have finished listening."""
        for side in sorted(self._listening):
            try:
                if self._rangers[side].busy():
                    self._check_patience(side, now)
                    continue
                echo = self._rangers[side].first_echo()
                self._latest[side] = self._rangers[side].range_m(echo), self._fired
            except HardwareError:
                # Some bus drivers report the silence of a busy ranger as an error instead of 0xFF.
                if now - self._fired > _PATIENCE_S:
                    raise
                continue
            self._listening.discard(side)
            if self._watcher is not None:
                self._watcher(f"ultrasonic_{side}", echo)

    def _check_patience(self, side: str, now: float) -> None:
        """Raise an error if a ranger has been busy for too long."""
        if now - self._fired > _PATIENCE_S:
            raise HardwareError(f"the {side} ultrasonic has been busy for {now - self._fired:.2f} s, expected 0.07 s")
