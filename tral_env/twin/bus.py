"""An I2C bus with chips on it: transactions, addresses, and the faults that buses have. No file and no kernel."""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Protocol

from tral_env.hardware.physical import Physical


class Chip(Protocol):
    """A device on the bus."""

    def answers_to(self, address: int) -> bool:
        """Whether the device takes part in a transaction with this address, 7 bit."""
        ...

    def write(self, address: int, data: Sequence[int]) -> bool:
        """Take bytes; False: it does not acknowledge."""
        ...

    def read(self, length: int) -> bytes:
        """Give bytes."""
        ...


@dataclass(frozen=True)
class I2cMessage:
    """A part of a transaction, from START to the next START or STOP."""

    address: int
    data: bytes = b""
    """Bytes to write."""
    length: int = 0
    """Number of bytes to read, if `reads`."""
    reads: bool = False


BusFault = Callable[[Sequence[I2cMessage]], None]
"""Raises the OSError of a transaction that fails, maybe after a while."""


class I2cBus:
    """Chips on two wires. A transaction is one call, and one at a time."""

    def __init__(self, chips: Sequence[Chip]) -> None:
        """Wire chips together."""
        self._chips = tuple(chips)
        self.lock = threading.Lock()
        """Held during a transaction; a thread that changes a chip from outside holds it too."""
        self.faults: dict[str, BusFault] = {}
        """Faults that are asked before each transaction, by name."""
        self.powered = True
        """Whether the chips have their supply; without it nobody answers."""
        self.after: Callable[[], None] = lambda: None
        """Called after each transaction that succeeded."""
        self.transactions = 0

    def transfer(self, messages: Sequence[I2cMessage]) -> list[bytes]:
        """Do a transaction.

        Returns:
            The bytes of each message that reads.

        Raises:
            OSError: nobody acknowledged, or the bus failed; its errno is that of Linux.
        """
        with self.lock:
            self.transactions += 1
            for fault in tuple(self.faults.values()):
                fault(messages)
            read = [found for message in messages if (found := self._message(message)) is not None]
            self.after()
        return read

    def _message(self, message: I2cMessage) -> bytes | None:
        present = [chip for chip in self._chips if self.powered and chip.answers_to(message.address)]
        if message.reads:
            if not present or message.address == 0:
                raise no_answer()
            # The wires are a wired AND: two that answer at once garble each other.
            answers = [chip.read(message.length) for chip in present]
            return bytes(reduce(int.__and__, column) for column in zip(*answers, strict=True))
        if not [chip for chip in present if chip.write(message.address, message.data)]:
            raise no_answer()
        return None


def no_answer() -> OSError:
    """The error of an address that nobody acknowledges, as Linux tells it."""
    return OSError(errno.EREMOTEIO, "Remote I/O error")


class TwinSmbus(Physical):
    """The bus as an object that speaks like ``smbus2.SMBus``: where the twin cannot show a file."""

    def __init__(self, bus: I2cBus) -> None:
        """Speak to the chips of a bus in this process."""
        self._bus = bus

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write bytes to a register and those behind it."""
        self._bus.transfer([I2cMessage(i2c_addr, bytes([register, *data]))])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read bytes of a register and those behind it."""
        return list(self._read(i2c_addr, bytes([register]), length))

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write a byte to a register."""
        self._bus.transfer([I2cMessage(i2c_addr, bytes([register, value]))])

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Read the byte of a register."""
        return self._read(i2c_addr, bytes([register]), 1)[0]

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Write one byte."""
        self._bus.transfer([I2cMessage(i2c_addr, bytes([value]))])

    def read_byte(self, i2c_addr: int) -> int:
        """Read one byte."""
        return self._bus.transfer([I2cMessage(i2c_addr, length=1, reads=True)])[0][0]

    def close(self) -> None:
        """Do nothing: the twin owns the bus."""

    def _read(self, address: int, register: bytes, length: int) -> bytes:
        written, read = I2cMessage(address, register), I2cMessage(address, length=length, reads=True)
        return self._bus.transfer([written, read])[0]
