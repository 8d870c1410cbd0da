"""Drivers: what the worker and its keeper need of a board, and the boards that there are."""

from __future__ import annotations

import difflib
import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from tral_env.errors import ConfigError
from tral_env.hardware.actuator.laws import clamped
from tral_env.hardware.actuator.options import check_quantities, quantity
from tral_env.hardware.actuator.pca9685 import Board
from tral_env.hardware.actuator.serial_boards import Board2016Options, UcboardOptions
from tral_env.hardware.actuator.settings import MAX_ADDRESS, MIN_ADDRESS, Settings
from tral_env.hardware.actuator.sysfs_pwm import SysfsPwmOptions
from tral_env.hardware.i2c import Bus

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ATTEMPTS = 3
"""A transaction is tried so often within one tick."""
BUDGET_S = 0.005
"""No attempt begins later than this after the first: a tick lasts 10 ms."""
GROUP = "tral_env.actuators"
"""Entry point group of boards of other distributions: an entry names a class as in `BOARDS`."""


class Driver(Protocol):
    """A board with two pulse outputs. A method that the board does not answer raises an OSError."""

    def start(self) -> None:
        """Set the board up with neutral on its outputs, also when it lost its settings."""

    def set_pulses(self, steering_us: float, throttle_us: float) -> None:
        """Send both pulses, us, within the limits of the channels."""

    def off(self) -> None:
        """End the pulses: no level, no last pulse."""

    def check(self) -> str:
        """Read the board's settings back: what is wrong with them, or nothing."""
        ...


class BoardOptions(Protocol):
    """A frozen dataclass with the options of a board, such as a car file gives them; it opens the board."""

    has_own_clock: ClassVar[bool]
    """Whether the length of the board's pulses hangs on an oscillator that has to be measured."""

    @property
    def device(self) -> int | str:
        """Device file of the board, or number of its I2C bus: one process alone may drive it."""
        ...

    def open(self, settings: Settings) -> Driver:
        """Open the board; nothing is sent yet.

        Raises:
            OSError: it cannot be opened.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Pca9685Options:
    """The PWM board PCA9685 on an I2C bus."""

    has_own_clock: ClassVar[bool] = True
    bus: int | str = quantity(1, 0, 255)
    """I2C bus by number or path; 1 is /dev/i2c-1."""
    address: int = quantity(0x40, MIN_ADDRESS, MAX_ADDRESS)
    """Address of the board, 7 bit."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)

    @property
    def device(self) -> int | str:
        """The bus."""
        return self.bus

    def open(self, settings: Settings) -> Driver:
        """Open the bus; see `BoardOptions.open`."""
        return Board(
            Bus(self.bus).device(self.address, "PWM board PCA9685"),
            period_us=settings.period_us,
            oscillator_hz=settings.oscillator_hz,
            steering=settings.steering,
            throttle=settings.throttle,
        )


@dataclass(frozen=True, kw_only=True)
class LogOptions:
    """No board: a file that takes the pulses, for tests and dry runs."""

    has_own_clock: ClassVar[bool] = False
    bus: str = "/dev/null"
    """Path of the file."""

    @property
    def device(self) -> str:
        """The file."""
        return self.bus

    def open(self, settings: Settings) -> Driver:
        """Open the file; see `BoardOptions.open`."""
        return LogDriver(self.bus, settings)


def takes_commands(options: BoardOptions) -> bool:
    """Whether a board makes the pulses by itself, from commands: no calibration of pulses changes what it does.

    Such a board says ``takes_commands = True``, and has the options `steering_reversed` and `throttle_reversed`.
    """
    return bool(getattr(options, "takes_commands", False))


class LogDriver:
    """Writes each pulse with its time into a file: ``<CLOCK_MONOTONIC in ns> <steering us> <throttle us>``; 0 0 is off.

    A FIFO as the file is a bus that blocks, ``/dev/full`` a bus that refuses.
    """

    def __init__(self, path: str, settings: Settings) -> None:
        """Open the file."""
        self._channels = settings.steering, settings.throttle
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)

    def start(self) -> None:
        """Write neutral."""
        self.set_pulses(*(channel.centre_us for channel in self._channels))

    def set_pulses(self, steering_us: float, throttle_us: float) -> None:
        """Write both pulses."""
        pulses = zip((steering_us, throttle_us), self._channels, strict=True)
        steering, throttle = (clamped(us, channel.min_us, channel.max_us) for us, channel in pulses)
        self._write(steering, throttle)

    def off(self) -> None:
        """Write that there are no pulses."""
        self._write(0.0, 0.0)

    def check(self) -> str:
        """Find nothing wrong."""
        return ""

    def _write(self, steering_us: float, throttle_us: float) -> None:
        os.write(self._file, f"{time.monotonic_ns()} {steering_us:g} {throttle_us:g}\n".encode())


BOARDS: Mapping[str, type[BoardOptions]] = {
    "pca9685": Pca9685Options,
    "sysfs-pwm": SysfsPwmOptions,
    "board2016": Board2016Options,
    "ucboard": UcboardOptions,
    "log": LogOptions,
}
"""Boards of this package by name."""


def board_names() -> tuple[str, ...]:
    """Names of all boards, those of other distributions too."""
    return tuple(dict.fromkeys([*BOARDS, *sorted(entry.name for entry in _foreign())]))


def board_class(name: str) -> type[BoardOptions]:
    """The class of a board.

    Raises:
        ConfigError: no board has this name, or its class cannot be loaded.
    """
    if name in BOARDS:
        return BOARDS[name]
    for entry in (entry for entry in _foreign() if entry.name == name):
        try:
            found: type[BoardOptions] = entry.load()
        except Exception as error:
            raise ConfigError(
                f"the board '{name}' ({entry.value}) cannot be loaded: {type(error).__name__}: {error}"
            ) from error
        return found
    match = difflib.get_close_matches(name, board_names(), n=1)
    hint = f"did you mean '{match[0]}'? " if match else ""
    raise ConfigError(f"unknown driver '{name}', {hint}expected {', '.join(board_names())}")


def _foreign() -> Iterable[EntryPoint]:
    """Boards of other distributions. A worker with a board of this package need not load what finds them."""
    from importlib.metadata import entry_points

    return entry_points(group=GROUP)


def open_driver(settings: Settings) -> Driver:
    """Open a board; nothing is sent yet.

    Raises:
        ConfigError: no driver has this name, or it does not take an option.
        MissingExtraError: the library of the bus is not installed.
        OSError: the bus cannot be opened.
    """
    kind: Any = board_class(settings.driver)
    options = settings.options
    if options is None:
        own = {each.name for each in fields(kind)}
        options = {name: value for name, value in (("bus", settings.bus), ("address", settings.address)) if name in own}
    driver: Driver = kind(**options).open(settings)
    return driver
