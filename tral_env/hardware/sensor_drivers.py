"""Drivers of sensors by name: their options as a car file gives them, and what opens them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from typing import Any, ClassVar, Literal, Protocol

from tral_env.config import UltrasonicConfig
from tral_env.errors import ConfigError, nearest
from tral_env.hardware.actuator.options import check_quantities, quantity
from tral_env.hardware.actuator.settings import MAX_ADDRESS, MIN_ADDRESS
from tral_env.hardware.hall_line import HallOptions
from tral_env.hardware.sensors import Sensors
from tral_env.hardware.serial_sensors import (
    Board2016SensorOptions,
    Board2016Sensors,
    UcboardSensorOptions,
    UcboardSensors,
)
from tral_env.hardware.sonar import ADDRESSES, SonarArray, Srf02, Srf08

GROUP = "tral_env.sensors"
"""Entry point group of sensors of other distributions: an entry names a class as in `SENSORS`."""
Clock = Callable[[], float]
Sleep = Callable[[float], None]


class SensorOptions(Protocol):
    """A frozen dataclass with the options of a sensor, such as a car file gives them; it opens the sensor."""

    def open(self, clock: Clock, sleep: Sleep) -> Sensors:
        """Open the device.

        Args:
            clock: the environment's clock, s.
            sleep: waits some seconds.

        Raises:
            HardwareError: no answer.
            MissingExtraError: its library is not installed.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Srf08Options:
    """Three SRF08 ultrasonics on an I2C bus."""

    ranger: ClassVar[type[Srf08]] = Srf08
    bus: int | str = quantity(1, 0, 255)
    """I2C bus by number or path; 1 is /dev/i2c-1."""
    addresses: Mapping[str, int] = field(default_factory=lambda: dict(ADDRESSES))
    """Side -> address, 7 bit."""
    firing: Literal["together", "in turn"] = "together"
    """"in turn" is three times slower, and has no crosstalk."""
    mode: Literal["us", "cm"] = "us"
    """Unit of the replies: microseconds reach 5 m, centimetres 3 m."""
    cadence_s: float = quantity(0.065, 0.02, 0.5, "s")
    """Time that one ranging takes, s."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)
        check_addresses(type(self).__name__, self.addresses)

    @property
    def oldest_s(self) -> float:
        """Age of a range just before the next one of its side comes, s: the cadences between, and its ranging."""
        return self.cadence_s * (len(self.addresses) if self.firing == "in turn" else 1) + UltrasonicConfig.cadence_s

    def open(self, clock: Clock, sleep: Sleep) -> Sensors:
        """Open the bus; see `SensorOptions.open`."""
        del clock
        config = UltrasonicConfig(mode=self.mode, cadence_s=self.cadence_s)
        return SonarArray(self.bus, config, self.addresses, self.firing, sleep, self.ranger)


@dataclass(frozen=True, kw_only=True)
class Srf02Options(Srf08Options):
    """Three SRF02 ultrasonics on an I2C bus; they hear nothing nearer than 0.15 m or more, see their data sheet."""

    ranger: ClassVar[type[Srf08]] = Srf02


def check_addresses(where: str, addresses: Mapping[str, int]) -> None:
    """Refuse addresses that are not those of some of left, front and right, each once.

    Raises:
        ConfigError: they are not.
    """
    if not addresses:
        raise ConfigError(f"{where}.addresses is empty: expected some of {', '.join(ADDRESSES)}")
    for side, address in addresses.items():
        if side not in ADDRESSES:
            raise ConfigError(f"{where}.addresses: unknown side '{side}': {nearest(side, ADDRESSES)}")
        if not MIN_ADDRESS <= address <= MAX_ADDRESS:
            hint = "; the data sheets' 0xE0 is 0x70 here, without the bit for reading" if address <= 0xFF else ""
            raise ConfigError(
                f"{where}.addresses.{side} = 0x{address:02x}: expected 0x{MIN_ADDRESS:02x} to 0x{MAX_ADDRESS:02x}{hint}"
            )
    if len(set(addresses.values())) < len(addresses):
        raise ConfigError(f"{where}.addresses: two sides have one address")


SENSORS: Mapping[str, type[SensorOptions]] = {
    "srf08": Srf08Options,
    "srf02": Srf02Options,
    "hall": HallOptions,
    "board2016": Board2016SensorOptions,
    "ucboard": UcboardSensorOptions,
}
"""Sensors of this package by name."""


def sensor_names() -> tuple[str, ...]:
    """Names of all sensors, those of other distributions too."""
    return tuple(dict.fromkeys([*SENSORS, *sorted(entry.name for entry in entry_points(group=GROUP))]))


def sensor_class(name: str) -> type[SensorOptions]:
    """The class of a sensor.

    Raises:
        ConfigError: no sensor has this name, or its class cannot be loaded.
    """
    if name in SENSORS:
        return SENSORS[name]
    for entry in entry_points(group=GROUP, name=name):
        try:
            found: Any = entry.load()
        except Exception as error:
            raise ConfigError(
                f"the sensor '{name}' ({entry.value}) cannot be loaded: {type(error).__name__}: {error}"
            ) from error
        kind: type[SensorOptions] = found
        return kind
    raise ConfigError(f"unknown sensors '{name}': {nearest(name, sensor_names())}")


def readings_of(options: SensorOptions) -> frozenset[str] | None:
    """Names of the readings of sensors that were not opened; None: unknown."""
    if isinstance(options, Srf08Options):
        return frozenset(f"ultrasonic_{side}{what}" for side in options.addresses for what in ("", "_age"))
    return {
        Board2016SensorOptions: Board2016Sensors.provided_readings,
        UcboardSensorOptions: UcboardSensors.provided_readings,
    }.get(type(options))
