"""The two serial boards of the original cars, as drivers of the worker: what the computer tells them.

Both boards make the pulses by themselves, so a command in pulses is turned back into shares of full lock and throttle:
the calibration cancels, and only the options of the board can turn a direction round.
Sources: the computer's side of the cars of 2016 (Apollo 13) and the manual of the later board (ucboard).
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar

from tral_env.hardware.actuator.laws import command_of
from tral_env.hardware.actuator.options import check_quantities, quantity
from tral_env.hardware.actuator.settings import Settings
from tral_env.hardware.serial_port import open_port, write_at_once

BAUD_2016, BAUD_UCBOARD = 115200, 921600
_STEERING_LEVELS, _MOTOR_LEVELS = 50, 10
"""The board of 2016 has so many levels to either side."""
_FORWARD, _BACKWARD = 1000, 500
"""The ucboard takes so much forward, and so much backward or as a brake."""
_DEAD_MAN_MS = 500
"""Without a command for this long, the ucboard stops the motor by itself, ms."""
RANGES, HALL, BATTERY = 1, 2, 3
"""Numbers of the groups of measurements that the ucboard sends."""
GROUPS = {RANGES: ("USL", "USF", "USR"), HALL: ("HALL_CNT", "HALL_DT"), BATTERY: ("VDBAT",)}
"""Group -> channels, in the order of their values: three ranges, count and spacing of the hall sensor, voltage."""
_SAMPLING = {RANGES: "~ALL=20", HALL: "~ANY", BATTERY: "~ANY"}
"""Group -> when it is sent: the ranges together, all else at each new value."""


@dataclass(frozen=True, kw_only=True)
class _SerialOptions:
    """What both boards have in common."""

    has_own_clock: ClassVar[bool] = False
    takes_commands: ClassVar[bool] = True
    port: str
    """Path of the serial port, such as /dev/ttyUSB0; one in /dev/serial/by-id stays the same."""
    steering_reversed: bool = False
    """Whether the servo turns the wheels the other way round, so that each steering is sent with the other sign."""
    throttle_reversed: bool = False
    """Whether the motor turns the other way round, so that each throttle is sent with the other sign."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)

    @property
    def device(self) -> str:
        """The port."""
        return self.port


@dataclass(frozen=True, kw_only=True)
class Board2016Options(_SerialOptions):
    """The serial board of 2016: a byte for the motor, a byte for the steering."""

    baud: int = quantity(BAUD_2016, 1200, 4000000)
    """Bits in a second."""

    def open(self, settings: Settings) -> Board2016:
        """Open the port; see `tral_env.hardware.actuator.drivers.BoardOptions.open`."""
        return Board2016(self, settings)


@dataclass(frozen=True, kw_only=True)
class UcboardOptions(_SerialOptions):
    """The later serial board (ucboard): lines of text, and a dead man's switch of its own."""

    baud: int = quantity(BAUD_UCBOARD, 1200, 4000000)
    """Bits in a second: 921600 at its USB plug, 115200 at its RS-232 plug."""

    def open(self, settings: Settings) -> Ucboard:
        """Open the port; see `tral_env.hardware.actuator.drivers.BoardOptions.open`."""
        return Ucboard(self, settings)


class _SerialDriver:
    """A port that is opened anew after it was lost."""

    def __init__(self, options: Board2016Options | UcboardOptions, settings: Settings) -> None:
        """Open the port; nothing is sent yet."""
        self._options = options
        self._steering, self._throttle = settings.steering, settings.throttle
        self._port: Any = open_port(options.port, options.baud)

    def start(self) -> None:
        """Send neutral."""
        self.set_pulses(self._steering.centre_us, self._throttle.centre_us)

    def set_pulses(self, steering_us: float, throttle_us: float) -> None:
        """Send the commands that the pulses carry out; each board has its own way."""

    def _commands(self, steering_us: float, throttle_us: float) -> tuple[float, float]:
        """Shares of full lock, + as the board steers left, and of full throttle, + forward; each in [-1, 1]."""
        left = command_of(steering_us, self._steering)
        return -left if self._options.steering_reversed else left, command_of(throttle_us, self._throttle)

    def _write(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            OSError: the port takes nothing now, or is lost. A lost one is opened anew at the next write, and then the
                board is set up in neutral before it takes anything else.
        """
        if self._port is None:
            self._port = open_port(self._options.port, self._options.baud)
            try:
                self.start()
            except BlockingIOError:
                self._drop()  # a board that did not get neutral gets nothing else
                raise
            raise OSError(f"{self._options.port} was opened anew, and the board was set up in neutral")
        try:
            write_at_once(self._port, data)
        except BlockingIOError:
            raise
        except OSError:
            self._drop()
            raise

    def _drop(self) -> None:
        """Close the port; the next write opens it anew."""
        port, self._port = self._port, None
        with suppress(OSError):
            port.close()


class Board2016(_SerialDriver):
    """The board of 2016. It knows no end of the pulses: level 0 is its only rest, and it repeats the last level."""

    def set_pulses(self, steering_us: float, throttle_us: float) -> None:
        """Send a motor level of -10 to 10 and a steering level of -50 to 50, + is right, a byte each."""
        left, forward = self._commands(steering_us, throttle_us)
        level, right = _level(forward, _MOTOR_LEVELS), -round(left * _STEERING_LEVELS)
        if self._options.throttle_reversed:
            level = -level
        self._write(bytes([0x80 + level + _MOTOR_LEVELS, right + _STEERING_LEVELS]))

    def off(self) -> None:
        """Send neutral: the board has nothing less."""
        self.start()

    def check(self) -> str:
        """Send nothing: the board reads no settings back. A port that is gone fails at the next pulses."""
        return ""


class Ucboard(_SerialDriver):
    """The ucboard. It brakes at the first throttle below 0 after forward, and reverses only after neutral.

    So it behaves as a motor controller that is driven by pulses; the board itself would change over at once. It has
    half the throttle backward, and brakes only after its own forward. So a motor that is reversed has half the throttle
    both ways, and coasts where it would brake.
    """

    def __init__(self, options: UcboardOptions, settings: Settings) -> None:
        """Open the port; nothing is sent yet."""
        super().__init__(options, settings)
        self._went_forward = self._brakes = False

    def start(self) -> None:
        """Set the dead man's switch, send neutral, and let the board send its measurements."""
        self._send(f"!DRV ~DMS={_DEAD_MAN_MS}")
        super().start()
        self._send("!DAQ STOP", "!US ON")
        self._send(*(f"!DAQ GRP {group} {_SAMPLING[group]} {' '.join(names)}" for group, names in GROUPS.items()))
        self._send("!DAQ START")

    def set_pulses(self, steering_us: float, throttle_us: float) -> None:
        """Send both commands, each number twice, so that the board refuses one that was garbled on the way."""
        left, forward = self._commands(steering_us, throttle_us)
        right = -round(left * _FORWARD)
        if forward > 0.0:  # noted before it is sent: a write that fails may have reached the board
            self._went_forward, self._brakes = True, False
        self._send(f"!STEER {right} {right}", self._drive(forward))
        if forward < 0.0:  # noted after it was sent: what the board never got must not allow reverse
            self._brakes = self._went_forward
        elif forward == 0.0 and self._brakes:
            self._went_forward = self._brakes = False

    def off(self) -> None:
        """Switch the motor controller off."""
        self._send("!DRV OFF")
        self._went_forward = self._brakes = False

    def check(self) -> str:
        """Set the dead man's switch again, which a board that was reset has forgotten."""
        self._send(f"!DRV ~DMS={_DEAD_MAN_MS}")
        return ""

    def _drive(self, forward: float) -> str:
        """The command for a share of full throttle."""
        is_reversed = self._options.throttle_reversed
        level = _level(abs(forward), _FORWARD if forward > 0.0 and not is_reversed else _BACKWARD)
        if forward < 0.0 and self._went_forward:
            brake = 0 if is_reversed else -level
            return f"!DRV F {brake} {brake}"
        way = "B" if (-forward if is_reversed else forward) < 0.0 else "F"
        return f"!DRV {way} {level} {level}"

    def _send(self, *lines: str) -> None:
        self._write("".join(f"{line}\n" for line in lines).encode("ascii"))


def _level(share: float, levels: int) -> int:
    """Level of a share of full throttle, rounded toward 0, so that none is above the limit of the throttle.

    A share comes back from its pulse with an error in its last digits, which must not cost a level.
    """
    return math.trunc(round(share * levels, 6))
