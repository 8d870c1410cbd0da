"""The I2C bus: one transaction at a time, and errors that tell which device was silent and what to do about it."""

from __future__ import annotations

import operator
import os
from collections.abc import Sequence
from typing import Protocol, SupportsIndex

from tral_env.errors import ConfigError, HardwareError, MissingExtraError

BusName = SupportsIndex | str | os.PathLike[str]
"""Number or path of an I2C bus."""


class Smbus(Protocol):
    """The part of ``smbus2.SMBus`` that is used here."""

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int], /) -> None:
        """Write bytes to a register and those behind it, in one transaction; OSError: no answer."""

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int, /) -> list[int]:
        """Read bytes of a register and those behind it, in one transaction; OSError: no answer."""
        ...

    def close(self) -> None:
        """Let go of the bus."""


def named(bus: BusName | Smbus) -> int | str | Smbus:
    """A bus by number, by path as text, or an open one.

    Raises:
        ConfigError: it is none of them.
    """
    if isinstance(bus, os.PathLike | str | bytes):
        return os.fsdecode(bus)
    if isinstance(bus, SupportsIndex) and not isinstance(bus, bool):
        return operator.index(bus)
    if not all(hasattr(bus, method) for method in ("write_i2c_block_data", "read_i2c_block_data", "close")):
        raise ConfigError(f"bus = {bus!r}: expected a number (1 is /dev/i2c-1), a path, or an object like smbus2.SMBus")
    opened: Smbus = bus  # type: ignore[assignment]
    return opened


class Bus:
    """An I2C bus by number, by device file, or anything that speaks like ``smbus2.SMBus``."""

    def __init__(self, bus: BusName | Smbus = 1) -> None:
        """Open the bus.

        Args:
            bus: number (1 is ``/dev/i2c-1``), path, or an open bus, which its owner closes.

        Raises:
            ConfigError: it is no bus.
            MissingExtraError: smbus2 is not installed.
            HardwareError: the bus cannot be opened.
        """
        bus = named(bus)
        self._owned = isinstance(bus, int | str)
        self.label = f"/dev/i2c-{bus}" if isinstance(bus, int) else bus if isinstance(bus, str) else type(bus).__name__
        self._smbus = _open(bus, self.label) if isinstance(bus, int | str) else bus

    def device(self, address: int, name: str) -> Device:
        """A device on this bus.

        Args:
            address: address of the device, 7 bit.
            name: name of the device in error messages.
        """
        return Device(self, address, name)

    def write(self, address: int, register: int, data: Sequence[int]) -> None:
        """Write bytes to a register of a device and those behind it; errors are those of the driver."""
        self._smbus.write_i2c_block_data(address, register, list(data))

    def read(self, address: int, register: int, length: int) -> list[int]:
        """Read bytes of a register of a device and those behind it; errors are those of the driver."""
        return self._smbus.read_i2c_block_data(address, register, length)

    def close(self) -> None:
        """Let go of the bus if this object opened it."""
        if self._owned:
            self._smbus.close()


class Device:
    """One address on a bus."""

    def __init__(self, bus: Bus, address: int, name: str) -> None:
        """Name a device; `Bus.device` makes one."""
        self._bus, self._address, self._name = bus, address, name

    def write(self, register: int, *data: int) -> None:
        """Write bytes to a register and those behind it, in one transaction.

        Raises:
            HardwareError: no answer.
        """
        try:
            self._bus.write(self._address, register, data)
        except OSError as error:
            raise self._silent(error) from error

    def read(self, register: int, length: int = 1) -> list[int]:
        """Read bytes of a register and those behind it, in one transaction.

        Raises:
            HardwareError: no answer.
        """
        try:
            return self._bus.read(self._address, register, length)
        except OSError as error:
            raise self._silent(error) from error

    def nonsense(self, got: str) -> HardwareError:
        """Word the error for an answer that cannot be right."""
        return HardwareError(f"{self._name} at 0x{self._address:02x} on {self._bus.label}: {got}")

    def _silent(self, error: OSError) -> HardwareError:
        return self.nonsense(
            f"no answer ({error}). Check its power, the wires SDA and SCL and its address; "
            "`i2cdetect -y <bus>` lists the addresses that answer"
        )


def _open(bus: int | str, label: str) -> Smbus:
    try:
        import smbus2
    except ImportError as error:
        raise MissingExtraError("smbus2", "car", "the I2C bus of the car") from error
    try:
        opened: Smbus = smbus2.SMBus(bus)
    except OSError as error:
        raise HardwareError(
            f"cannot open the I2C bus {label} ({error}). Switch I2C on in the computer's settings and add the user to "
            "the group i2c; without a car, output='recorder' is a dry run"
        ) from error
    return opened
