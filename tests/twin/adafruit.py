"""Adafruit's library for the PCA9685 at a bus that speaks like smbus2: an oracle that knows nothing of this project."""

from __future__ import annotations

from typing import Any


class BusIO:
    """The part of ``busio.I2C`` that Adafruit's ``I2CDevice`` uses, over ``smbus2.i2c_rdwr``-like calls."""

    def __init__(self, write: Any, write_then_read: Any) -> None:
        """Take what writes bytes to an address, and what writes bytes and reads some behind them."""
        self._write, self._write_then_read = write, write_then_read

    def try_lock(self) -> bool:
        return True

    def unlock(self) -> None:
        return

    def writeto(self, address: int, buffer: Any, *, start: int = 0, end: int | None = None, **_: Any) -> None:
        self._write(address, bytes(buffer)[start:end])

    def readfrom_into(self, address: int, buffer: Any, *, start: int = 0, end: int | None = None) -> None:
        end = len(buffer) if end is None else end
        buffer[start:end] = self._write_then_read(address, b"", end - start)

    def writeto_then_readfrom(
        self,
        address: int,
        out: Any,
        into: Any,
        *,
        out_start: int = 0,
        out_end: int | None = None,
        in_start: int = 0,
        in_end: int | None = None,
    ) -> None:
        in_end = len(into) if in_end is None else in_end
        into[in_start:in_end] = self._write_then_read(address, bytes(out)[out_start:out_end], in_end - in_start)
