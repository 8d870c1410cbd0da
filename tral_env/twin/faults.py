"""Faults on demand: what each does to a twin, by name.

A fault begins and ends; `FaultInjector.at` lets it begin at a time on the twin's clock. The table is the documentation,
too.
"""

from __future__ import annotations

import errno
import math
import os
import random
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from tral_env.checks import check_number
from tral_env.errors import ConfigError, nearest
from tral_env.twin.bus import I2cBus, I2cMessage, no_answer
from tral_env.twin.car import TwinCar
from tral_env.twin.pca9685 import Pca9685Chip
from tral_env.twin.pulse_log import PulseLog
from tral_env.twin.receivers import MotorController, Servo
from tral_env.twin.serial_port import SerialPort
from tral_env.twin.srf08 import Srf08Chip

BLOCKS_S = 1.0
"""A bus that times out blocks for so long, s: the kernel's default for an adapter."""
FILLER = "filler"
"""The file that fills the disk."""


class TwinParts(Protocol):
    """The parts of a twin that can fail."""

    bus: I2cBus
    pca9685: Pca9685Chip
    pulses: PulseLog
    rangers: dict[str, Srf08Chip]
    ports: dict[str, SerialPort]
    car: TwinCar
    servo: Servo
    controller: MotorController
    clock: Callable[[], float]
    camera_gone: bool
    camera_frozen: bool

    @property
    def disk(self) -> Path:
        """A small disk of its own."""
        ...


@dataclass(frozen=True)
class InjectedFault:
    """A fault: what begins it and what ends it."""

    told: str
    """What a person sees of it."""
    begin: Callable[[TwinParts, float], None]
    """Begins it, with a rate in (0, 1]."""
    end: Callable[[TwinParts], None]
    check: Callable[[TwinParts], None] = lambda twin: None
    """Raises a ConfigError if the twin cannot have it."""


class RandomBusErrors:
    """A share of transactions that nobody acknowledges."""

    def __init__(self, rate: float, seed: int = 0) -> None:
        """Fail a share `rate` of transactions."""
        self._rate, self._rng = rate, random.Random(seed)

    def __call__(self, messages: Sequence[I2cMessage]) -> None:
        """Raise errno 121, or not."""
        if self._rng.random() < self._rate:
            raise no_answer()


class BusTimeouts:
    """Transactions that block, then time out."""

    def __init__(self, sleep: Callable[[float], None] = time.sleep) -> None:
        """Block by `sleep`."""
        self._sleep = sleep

    def __call__(self, messages: Sequence[I2cMessage]) -> None:
        """Raise errno 110 after a while."""
        self._sleep(BLOCKS_S)
        raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))


def stuck(messages: Sequence[I2cMessage]) -> None:
    """Raise errno 11: the adapter never wins the bus, because something holds SDA low."""
    raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))


def _on_bus(name: str, make: Callable[[float], Callable[[Sequence[I2cMessage]], None]]) -> tuple[BeginFault, EndFault]:
    def begin(twin: TwinParts, rate: float) -> None:
        twin.bus.faults[name] = make(rate)

    def end(twin: TwinParts) -> None:
        twin.bus.faults.pop(name, None)

    return begin, end


def _flag(*path: str, value: object = True, otherwise: object = False) -> tuple[BeginFault, EndFault]:
    """Set an attribute of a part of the twin, and set it back."""

    def put(twin: TwinParts, what: object) -> None:
        part: object = twin
        for name in path[:-1]:
            part = getattr(part, name)
        for each in part.values() if isinstance(part, dict) else [part]:
            setattr(each, path[-1], what)

    return (lambda twin, rate: put(twin, value)), (lambda twin: put(twin, otherwise))


def _brown_out(twin: TwinParts, rate: float) -> None:
    with twin.bus.lock:
        twin.pca9685.power_cycle()
        twin.pulses.note()


def _nothing(twin: TwinParts) -> None:
    """End nothing: it happened once."""


def _unarm(twin: TwinParts, rate: float) -> None:
    twin.controller.power_cycle()
    twin.controller.refuses = True


def _rearm(twin: TwinParts) -> None:
    twin.controller.refuses = False


def _unplug(twin: TwinParts, rate: float) -> None:
    for port in twin.ports.values():
        port.unplug()


def _plug_in(twin: TwinParts) -> None:
    for port in twin.ports.values():
        port.plug_in()


def fill(folder: Path) -> None:
    """Fill the file system of a folder to the last byte."""
    with (folder / FILLER).open("wb", buffering=0) as file:
        for size in (1 << 20, 4096, 1):
            while True:
                try:
                    file.write(b"\0" * size)
                except OSError as error:
                    if error.errno != errno.ENOSPC:
                        raise
                    break


def _require_disk(twin: TwinParts) -> None:
    if not os.path.ismount(twin.disk):
        raise ConfigError(f"{twin.disk} is no disk of the twin: it needs device files, so root and /dev/fuse")


def _fill(twin: TwinParts, rate: float) -> None:
    fill(twin.disk)


def _unfill(twin: TwinParts) -> None:
    (twin.disk / FILLER).unlink(missing_ok=True)


BeginFault = Callable[["TwinParts", float], None]
EndFault = Callable[["TwinParts"], None]

INJECTED_FAULTS: dict[str, InjectedFault] = {
    "i2c-errors": InjectedFault(
        "a share (--rate, 0.1) of transactions on the I2C bus fails with errno 121",
        *_on_bus("i2c-errors", RandomBusErrors),
    ),
    "i2c-timeout": InjectedFault(
        "each transaction on the I2C bus blocks for 1 s, then fails with errno 110",
        *_on_bus("i2c-timeout", lambda rate: BusTimeouts()),
    ),
    "bus-stuck": InjectedFault(
        "something holds the I2C bus low: each transaction fails at once with errno 11",
        *_on_bus("bus-stuck", lambda rate: stuck),
    ),
    "brown-out": InjectedFault(
        "the PWM board loses its supply for a moment: all its registers have power-on values", _brown_out, _nothing
    ),
    "sonar-silent": InjectedFault("the ultrasonics do not answer on the bus", *_flag("rangers", "silent")),
    "sonar-frozen": InjectedFault(
        "the ultrasonics answer, always with the ranges that they had", *_flag("rangers", "frozen")
    ),
    "hall-off": InjectedFault("no edge of the hall sensor comes", *_flag("car", "hall_off")),
    "hall-bouncing": InjectedFault(
        "each edge of the hall sensor comes three times within 1.1 ms", *_flag("car", "hall_bounces")
    ),
    "serial-unplugged": InjectedFault("both serial ports are gone; their readers get an error", _unplug, _plug_in),
    "serial-garbage": InjectedFault(
        "5 % of the bytes on the serial lines are lost, changed or too many", *_flag("ports", "garbage")
    ),
    "camera-gone": InjectedFault("the camera's connections end, and it takes no new ones", *_flag("camera_gone")),
    "camera-frozen": InjectedFault("the camera sends the same image again and again", *_flag("camera_frozen")),
    "battery-sagging": InjectedFault(
        "the drive battery loses 0.5 V a second, down to 4.5 V", *_flag("car", "sags_v_per_s", value=0.5, otherwise=0.0)
    ),
    "servo-reversed": InjectedFault("the servo turns the other way", *_flag("servo", "reversed")),
    "esc-unarmed": InjectedFault("the motor controller is not armed, and does not arm", _unarm, _rearm),
    "disk-full": InjectedFault(
        "no byte is left on the twin's disk, the folder `disk` beside its other files", _fill, _unfill, _require_disk
    ),
}
"""Faults by name."""


class FaultInjector:
    """The faults of one twin: which are active, and which are to come."""

    def __init__(self, twin: TwinParts) -> None:
        """None is active."""
        self._twin = twin
        self.active: dict[str, float] = {}
        """Name -> end, s on the twin's clock; infinite: until `end`."""
        self._coming: list[tuple[float, str, float, float]] = []
        self._lock = threading.Lock()

    def begin(self, name: str, *, rate: float = 0.1, seconds: float = math.inf) -> None:
        """Begin a fault now.

        Args:
            name: one of `INJECTED_FAULTS`.
            rate: share of what fails, for faults that have one.
            seconds: it ends by itself after so long.

        Raises:
            ConfigError: no fault has this name, or the rate or the time is none.
        """
        _fault(name, rate, seconds).check(self._twin)
        self._begin(name, rate, self._twin.clock() + seconds)

    def end(self, name: str) -> None:
        """End a fault; one that is not active stays so, and one that is to come does not.

        Raises:
            ConfigError: no fault has this name.
        """
        self._end(name)
        with self._lock:
            self._coming = [each for each in self._coming if each[1] != name]

    def at(self, time_s: float, name: str, *, rate: float = 0.1, seconds: float = math.inf) -> None:
        """Begin a fault at a time on the twin's clock, s; see `begin`."""
        _fault(name, rate, seconds).check(self._twin)
        with self._lock:
            self._coming.append((time_s, name, rate, seconds))

    def turn(self, now_s: float) -> None:
        """Begin and end what is due."""
        with self._lock:
            due = [each for each in self._coming if each[0] <= now_s]
            self._coming = [each for each in self._coming if each[0] > now_s]
        for _, name, rate, seconds in due:
            self._begin(name, rate, now_s + seconds)
        for name, end_s in tuple(self.active.items()):
            if end_s <= now_s:
                self._end(name)

    def _begin(self, name: str, rate: float, end_s: float) -> None:
        _fault(name, rate).begin(self._twin, rate)
        self.active[name] = end_s

    def _end(self, name: str) -> None:
        _fault(name, 1.0).end(self._twin)
        self.active.pop(name, None)


def _fault(name: str, rate: float, seconds: float = math.inf) -> InjectedFault:
    if name not in INJECTED_FAULTS:
        raise ConfigError(f"unknown fault '{name}': {nearest(name, INJECTED_FAULTS)}")
    check_number("rate", rate)
    if not 0 < rate <= 1:
        raise ConfigError(f"rate = {rate!r}: expected a share above 0, at most 1")
    if seconds != math.inf:
        check_number("seconds", seconds, "s")
    if not seconds > 0:
        raise ConfigError(f"seconds = {seconds!r}: expected a time above 0")
    return INJECTED_FAULTS[name]
