"""The two serial boards of the original cars as models: bytes in, commands and frames out. No port, no file.

2016: the board sends 13 bytes, `00 0F`, then front, right, left, line, hall, battery, low byte first; it takes single
bytes (source: car_handler of Nsteel/Apollo_13). Later: text, answers between 0x02 and 0x03 (source:
doc/latex/inc/kommunikation of tud-pses/ucboard).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from tral_env.hardware.pulses import CarCalibration, pulses
from tral_env.interface import NO_ECHO_M


@dataclass(frozen=True, kw_only=True)
class BoardReadings:
    """What the sensors of a board read now."""

    range_m: Mapping[str, float]
    """Side -> range of the last ranging, m; `NO_ECHO_M`: no echo."""
    ranging: int
    """Counts the rangings."""
    ticks: int
    """Edges of the hall sensor since power-on."""
    spacing_s: float
    """Time between the last two edges, s."""
    turn_s: float
    """Time of the last eight edges, a turn of the wheel, s."""
    battery_v: float
    line: int = 0


class SerialBoard(Protocol):
    """A board on a serial port."""

    baud: int

    def hear(self, data: bytes, now_s: float) -> bytes:
        """Take bytes from the computer; gives back the answer."""
        ...

    def speak(self, readings: BoardReadings, now_s: float) -> bytes:
        """What the board sends by itself until now."""
        ...

    def pulses_us(self, now_s: float) -> tuple[float, float]:
        """Pulses of steering and throttle, us; 0: none."""
        ...


UNITS_PER_M = 1500 / 1.60
"""Hall units of 2016 in a metre. Source: report."""
METRES_PER_TICK = 0.02513
_FRAME = struct.Struct("<BBHHHBHH")
FRAME_PERIOD_S = 0.02
"""The board of 2016 sends a frame this often, s. Source: choice."""
_MOTOR_LEVELS, _STEERING_LEVELS = 10, 50


class SimulatedBoard2016:
    """The board of 2016. Ranges are in centimetres, the battery in mV (both: choice).

    A range stands in one frame after its ranging; in the others, and without an echo, it is 0, which a reader takes
    for "as before". So a repeated range is not taken for a new one.
    """

    baud = 115200

    def __init__(self, calibration: CarCalibration) -> None:
        """Stand; `calibration` are the pulses of its servo and motor controller."""
        self._calibration = calibration
        self.motor_level = self.steering_level = 0
        self._due_s, self._ranging = 0.0, -1

    def hear(self, data: bytes, now_s: float) -> bytes:
        """Each byte is a command; one beyond the levels is ignored."""
        for byte in data:
            if byte & 0x80:
                level = byte - 0x80 - _MOTOR_LEVELS
                self.motor_level = level if abs(level) <= _MOTOR_LEVELS else self.motor_level
            else:
                level = byte - _STEERING_LEVELS
                self.steering_level = level if abs(level) <= _STEERING_LEVELS else self.steering_level
        return b""

    def speak(self, readings: BoardReadings, now_s: float) -> bytes:
        """A frame, when one is due."""
        if now_s < self._due_s:
            return b""
        self._due_s = max(self._due_s + FRAME_PERIOD_S, now_s)
        hall = int(readings.ticks * METRES_PER_TICK * UNITS_PER_M) & 0xFFFF
        fresh, self._ranging = readings.ranging != self._ranging, readings.ranging
        ranges = [_units(readings.range_m[side], 0.01) if fresh else 0 for side in ("front", "right", "left")]
        return _FRAME.pack(0x00, 0x0F, *ranges, readings.line, hall, round(readings.battery_v * 1e3))

    def pulses_us(self, now_s: float) -> tuple[float, float]:
        """The levels as pulses; + is right for this board."""
        command = [-self.steering_level / _STEERING_LEVELS, self.motor_level / _MOTOR_LEVELS]
        steering_us, throttle_us = pulses(command, self._calibration).tolist()
        return steering_us, throttle_us


def _units(range_m: float, unit_m: float) -> int:
    """A range as the boards send it; 0: no echo."""
    return 0 if range_m >= NO_ECHO_M else min(round(range_m / unit_m), 0xFFFB)


STX, ETX = b"\x02", b"\x03"
_MAX_LINE = 1024
_MAX_GROUP = 19
_RANGES = {"USF": "front", "USL": "left", "USR": "right"}
_NOTHING = "[---]"
_BATTERY_S = 0.1
"""The later board measures its batteries this often, s. Source: choice."""


def _version(channel: str, readings: BoardReadings, now_s: float) -> int:
    """A number that changes when a channel has a new value."""
    if channel in _RANGES:
        return readings.ranging
    return readings.ticks if channel.startswith("HALL") else int(now_s / _BATTERY_S)


@dataclass
class _Group:
    channels: tuple[str, ...]
    period_s: float | None
    """Time between two messages, s; None: one for each new value."""
    active: bool = True
    due_s: float = 0.0
    sent: tuple[int, ...] = ()
    """Which values the last message had, as `_version` tells them apart."""


@dataclass
class SimulatedUcboard:
    """The later board (ucboard), with the commands that drivers of cars use; its measuring groups are readable text."""

    calibration: CarCalibration
    """Pulses of its servo and motor controller."""
    steering: int = 0
    """Set point in -1000 .. 1000, + is right."""
    drive: str = "OFF"
    """As `?DRV` tells it."""
    dead_man_s: float = 0.0
    """The motor stops when no `!DRV` came for so long, s; 0: never."""
    sonars: bool = True
    measuring: bool = False
    _groups: dict[int, _Group] = field(default_factory=dict)
    _line: bytes = b""
    _driven_s: float = 0.0
    _readings: BoardReadings | None = None
    _session: int = 0

    baud = 921600

    def hear(self, data: bytes, now_s: float) -> bytes:
        """Take bytes; each line is a command, and has an answer."""
        *lines, rest = (self._line + data).split(b"\n")
        self._line = rest[-_MAX_LINE:]
        answers = [self._answer(line.decode("latin-1"), now_s) for line in lines if line.strip()]
        return b"".join(STX + answer.encode() + ETX + b"\n" for answer in answers)

    def speak(self, readings: BoardReadings, now_s: float) -> bytes:
        """The messages of the measuring groups that are due."""
        self._readings = readings
        if not self.measuring:
            return b""
        said = b""
        for number, group in sorted(self._groups.items()):
            if group.active and self._is_due(group, readings, now_s):
                values = " | ".join(self._value(channel) for channel in group.channels)
                said += STX + f"##{number}:{values}".encode() + ETX + b"\n"
        return said

    def pulses_us(self, now_s: float) -> tuple[float, float]:
        """Pulses of the set points; none for the motor when the controller is off."""
        steering_us, throttle_us = pulses([-self.steering / 1000, self._throttle(now_s)], self.calibration).tolist()
        kind, _, value = self.drive.partition(" ")
        if kind == "OFF":
            return steering_us, 0.0
        return steering_us, 1500.0 + int(value) if kind == "D" and not self._is_dead(now_s) else throttle_us

    def _throttle(self, now_s: float) -> float:
        kind, _, value = self.drive.partition(" ")
        if kind not in ("F", "B") or self._is_dead(now_s):
            return 0.0
        number = int(value)
        return -number / 500 if kind == "B" else number / (1000 if number > 0 else 500)

    def _is_dead(self, now_s: float) -> bool:
        return self.dead_man_s > 0 and now_s - self._driven_s > self.dead_man_s

    def _answer(self, line: str, now_s: float) -> str:
        words = line.strip().upper().split()
        start, words = words[0][0], [word for word in (words[0][1:], *words[1:]) if word]
        options = dict(word[1:].partition("=")[::2] for word in words if word[0] == "~")
        arguments = [word for word in words if word[0] != "~"]
        handlers: Mapping[str, Callable[[str, list[str], dict[str, str], float], str]] = {
            "DRV": self._drv, "STEER": self._steer, "US": self._us, "DAQ": self._daq,
            "VER": lambda *_: ":0.1.0", "ID": lambda *_: ":4", "SID": self._sid,
            "TICS": lambda *_: f":{round(now_s * 1e3)}",
        }  # fmt: skip
        if start not in "!?" or not arguments or arguments[0] not in handlers:
            return ":ERR(256):Unknown command!"
        try:
            return handlers[arguments[0]](start, arguments[1:], options, now_s)
        except (ValueError, LookupError):
            return ":ERR(257):Wrong arguments!"

    def _drv(self, start: str, arguments: list[str], options: dict[str, str], now_s: float) -> str:
        if start == "?":
            return f":{self.drive}" + (f" ~DMS={round(self.dead_man_s * 1e3)}" if "DMS" in options else "")
        if "DMS" in options:
            self.dead_man_s = int(options["DMS"]) / 1e3
        self._driven_s = now_s
        if not arguments:
            return f":~DMS={options['DMS']}" if "DMS" in options else ":ok"
        kind, numbers = arguments[0], [int(each) for each in arguments[1:]]
        if kind == "OFF":
            self.drive = "OFF"
            return ":OFF"
        if len(set(numbers)) > 1:
            return ":ERR(269): Message corrupted! (The two values have to be equal!)"
        low, high = {"F": (-500, 1000), "B": (0, 500), "D": (-500, 500)}.get(kind, (1, 0))
        if not low <= numbers[0] <= high:
            return ":ERR(258):Out of range!"
        self.drive = f"{kind} {numbers[0]}"
        return f":{self.drive}"

    def _steer(self, start: str, arguments: list[str], options: dict[str, str], now_s: float) -> str:
        if start == "!":
            numbers = [int(each) for each in arguments]
            if len(set(numbers)) > 1:
                return ":ERR(269): Message corrupted! (The two values have to be equal!)"
            if not -1000 <= numbers[0] <= 1000:
                return ":ERR(258):Out of range!"
            self.steering = numbers[0]
        return f":{self.steering}"

    def _us(self, start: str, arguments: list[str], options: dict[str, str], now_s: float) -> str:
        if start == "!":
            self.sonars = {"ON": True, "OFF": False}.get(arguments[0], self.sonars)
        return ":ON" if self.sonars else ":OFF"

    def _sid(self, start: str, arguments: list[str], options: dict[str, str], now_s: float) -> str:
        if start == "!":
            self._session = int(arguments[0])
        return f":{self._session}"

    def _daq(self, start: str, arguments: list[str], options: dict[str, str], now_s: float) -> str:
        kind = arguments[0] if arguments else ""
        if kind in ("START", "STOP"):
            self.measuring = kind == "START"
        elif kind == "GET":
            return ":" + " | ".join(self._value(channel) for channel in arguments[1:])
        elif kind == "GRP":
            return self._define(int(arguments[1]), tuple(arguments[2:]), options)
        return ":started" if self.measuring else ":stopped"

    def _define(self, number: int, channels: tuple[str, ...], options: dict[str, str]) -> str:
        if not 0 <= number <= _MAX_GROUP:
            return ":ERR(258):Out of range!"
        if "DELETE" in options:
            self._groups.pop(number, None)
        elif channels:
            if options.get("ENC", "ASCII") != "ASCII":
                return ":ERR(259):Not supported!"
            period_s = int(options["TS"]) / 1e3 if "TS" in options else None
            self._groups[number] = _Group(channels, period_s, "DEACTIVATE" not in options)
        else:
            self._groups[number].active = "DEACTIVATE" not in options
        return ":ok"

    def _is_due(self, group: _Group, readings: BoardReadings, now_s: float) -> bool:
        if group.period_s is None:
            versions = tuple(_version(channel, readings, now_s) for channel in group.channels)
            fresh, group.sent = versions != group.sent, versions
            return fresh
        if now_s < group.due_s:
            return False
        group.due_s = max(group.due_s + group.period_s, now_s)
        return True

    def _value(self, channel: str) -> str:
        readings = self._readings
        if readings is None:
            return _NOTHING
        if channel in _RANGES:
            if not self.sonars:
                return _NOTHING
            units = _units(readings.range_m[_RANGES[channel]], 1e-4)
            return str(units) if units else "[over]"
        values = {
            "HALL_CNT": readings.ticks % 256,
            "HALL_DT": min(readings.spacing_s * 1e4, 0xFFFB),
            "HALL_DT8": min(readings.turn_s * 1e3, 0xFFFB),
            "VDBAT": readings.battery_v * 1e3,
            "VSBAT": readings.battery_v * 1e3,
        }
        return str(round(values[channel])) if channel in values else _NOTHING
