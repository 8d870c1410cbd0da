"""Drivers: what the worker and its keeper need of a board, and the boards that there are."""

from __future__ import annotations

import os
import time
from typing import Protocol

from tral_env.errors import ConfigError
from tral_env.hardware.actuator.laws import clamped
from tral_env.hardware.actuator.pca9685 import Board
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.i2c import Bus

ATTEMPTS = 3
"""A transaction is tried so often within one tick."""
BUDGET_S = 0.005
"""No attempt begins later than this after the first: a tick lasts 10 ms."""


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


class LogDriver:
    """Writes each pulse with its time into a file: ``<CLOCK_MONOTONIC in ns> <steering us> <throttle us>``; 0 0 is off.

    A FIFO as the file is a bus that blocks, ``/dev/full`` a bus that refuses.
    """

    def __init__(self, settings: Settings) -> None:
        """Open the file."""
        self._channels = settings.steering, settings.throttle
        self._file = os.open(str(settings.bus), os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)

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


def _pca9685(settings: Settings) -> Driver:
    return Board(
        Bus(settings.bus).device(settings.address, "PWM board PCA9685"),
        period_us=settings.period_us,
        oscillator_hz=settings.oscillator_hz,
        steering=settings.steering,
        throttle=settings.throttle,
    )


DRIVERS = {"pca9685": _pca9685, "log": LogDriver}
"""Drivers by name."""


def open_driver(settings: Settings) -> Driver:
    """Open a board; nothing is sent yet.

    Raises:
        ConfigError: no driver has this name.
        MissingExtraError: the library of the bus is not installed.
        OSError: the bus cannot be opened.
    """
    if settings.driver not in DRIVERS:
        raise ConfigError(f"unknown driver '{settings.driver}', expected {', '.join(DRIVERS)}")
    driver: Driver = DRIVERS[settings.driver](settings)
    return driver
