"""The sensors of the two serial boards of the original cars, as `Sensors`. They read the port and never write to it.

The board's driver in the actuator's process writes to the same port, and sets the board up.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tral_env.config import HallConfig, UltrasonicConfig
from tral_env.errors import HardwareError
from tral_env.geometry import HALL_METRES_PER_TICK
from tral_env.hardware.actuator.options import check_quantities, quantity
from tral_env.hardware.actuator.serial_boards import BAUD_2016, BAUD_UCBOARD
from tral_env.hardware.physical import Physical
from tral_env.hardware.sensors import FrameWatcher, HallCounter, Sensors
from tral_env.hardware.serial_frames import FrameParser, SerialFrame, TextParser
from tral_env.hardware.serial_port import open_port
from tral_env.interface import NO_ECHO_M, OPTIONAL_GROUPS
from tral_env.sensors.hall import WindowSpeed
from tral_env.sensors.ultrasonic import readable

_PATIENCE_S = 0.5
"""A board that says nothing for longer counts as broken."""
_MAX_BYTES = 65536
"""At most so many bytes are read at once."""
_SIDES = ("left", "front", "right")
_UNITS_PER_M = 937.5
"""Count of the hall sensor of the board of 2016 for a metre: 1500 for 1.60 m. Source: report."""
_MAX_SPEED = HallConfig().max_speed
_NO_ECHO_S = 0.2
"""A range of 0 keeps the old one, because it stands for "nothing new" too; 0 for longer than three rangings means that
no echo comes, s."""
_QUEUED_S = 0.1
"""What is read at once may have come so long apart, s."""
_MAX_BATTERY_V = OPTIONAL_GROUPS["battery"][0].high
"""A higher voltage is garbled."""
_RANGES = UltrasonicConfig()
_ALL_RANGES = frozenset(f"ultrasonic_{side}{what}" for side in _SIDES for what in ("", "_age"))


@dataclass(frozen=True, kw_only=True)
class Board2016SensorOptions:
    """The sensors of the serial board of 2016."""

    port: str
    """Path of the serial port; the same as that of the board."""
    baud: int = quantity(BAUD_2016, 1200, 4000000)
    """Bits in a second."""
    range_unit_m: float = quantity(0.01, 1e-5, 0.1, "m")
    """Range that one unit stands for, m. Source: choice, centimetres as in the report; a tape measure decides."""
    units_per_m: float = quantity(_UNITS_PER_M, 1.0, 1e5)
    """Units of the hall sensor for a metre of travel."""
    battery_unit_v: float = quantity(0.001, 1e-4, 1.0, "V")
    """Voltage that one unit stands for, V. Source: choice; a voltmeter decides."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)

    def open(self, clock: Callable[[], float], sleep: Callable[[float], None]) -> Sensors:
        """Open the port; see `tral_env.hardware.sensor_drivers.SensorOptions.open`."""
        del sleep
        return Board2016Sensors(self, clock)


@dataclass(frozen=True, kw_only=True)
class UcboardSensorOptions:
    """The sensors of the later serial board (ucboard)."""

    port: str
    """Path of the serial port; the same as that of the board."""
    baud: int = quantity(BAUD_UCBOARD, 1200, 4000000)
    """Bits in a second."""
    metres_per_tick: float = quantity(HALL_METRES_PER_TICK, 0.001, 0.5, "m")
    """Travel of the wheel from magnet to magnet, m."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)

    def open(self, clock: Callable[[], float], sleep: Callable[[float], None]) -> Sensors:
        """Open the port; see `tral_env.hardware.sensor_drivers.SensorOptions.open`."""
        del sleep
        return UcboardSensors(self, clock)


class _SerialSensors(Physical):
    """What both boards have in common: a port that is read, ranges that stay until newer ones come."""

    def __init__(self, port: str, baud: int, clock: Callable[[], float]) -> None:
        """Open the port.

        Raises:
            MissingExtraError: pyserial is not installed.
            HardwareError: the port cannot be opened.
        """
        self._name, self._clock = port, clock
        self._port: Any = open_port(port, baud)
        self._ranges: dict[str, tuple[float, float]] = {}
        self._heard_s = math.inf
        self._battery: float | None = None
        self._watcher: FrameWatcher | None = None

    def watch_frames(self, watcher: FrameWatcher) -> None:
        """Call a watcher with all bytes that the board sends, under the name of the port."""
        self._watcher = watcher

    def start(self) -> None:
        """Forget all readings, and all bytes that waited."""
        self._heard()
        self._ranges, self._battery = {}, None
        self._heard_s = self._clock()

    def stop(self) -> None:
        """Close the port."""
        if self._port is not None:
            self._port.close()
            self._port = None

    def _heard(self) -> bytes:
        """The bytes that wait."""
        try:
            data: bytes = self._port.read(_MAX_BYTES)
        except OSError as error:
            raise HardwareError(f"the serial board at {self._name} is lost ({error}): is its plug in?") from error
        if data and self._watcher is not None:
            self._watcher(self._name, data)
        return data

    def _take_range(self, side: str, metres: float, now: float) -> None:
        self._ranges[side] = (metres if readable(metres, _RANGES) else NO_ECHO_M), now

    def _take_battery(self, volts: float) -> None:
        if volts <= _MAX_BATTERY_V:
            self._battery = volts

    def _told(self, now: float, is_new: bool) -> dict[str, float]:
        """Ranges with their ages, and the battery.

        Raises:
            HardwareError: the board has said nothing for too long.
        """
        if is_new:
            self._heard_s = now
        elif now - self._heard_s > _PATIENCE_S:
            raise HardwareError(
                f"the serial board at {self._name} has sent nothing that makes sense for {now - self._heard_s:.1f} s: "
                "check its power, and port and baud in the car file"
            )
        readings: dict[str, float] = {} if self._battery is None else {"battery": self._battery}
        for side, (metres, heard_s) in self._ranges.items():
            readings[f"ultrasonic_{side}"] = metres
            readings[f"ultrasonic_{side}_age"] = now - heard_s
        return readings


class Board2016Sensors(_SerialSensors):
    """Ranges, distance, speed, line and battery from the frames of the board of 2016."""

    provided_readings = _ALL_RANGES | {"distance", "speed", "line", "battery"}

    def __init__(self, options: Board2016SensorOptions, clock: Callable[[], float] = time.monotonic) -> None:
        """Open the port; see `_SerialSensors`."""
        super().__init__(options.port, options.baud, clock)
        self._options = options
        self._parser, self._travel, self._line = FrameParser(), _Travel(options.units_per_m), 0
        self._echo_s: dict[str, float] = {}
        """Side -> time of its last range that was not 0, s."""

    def start(self) -> None:
        """Begin anew; see `Sensors.start`."""
        super().start()
        self._parser, self._travel, self._line = FrameParser(), _Travel(self._options.units_per_m), 0
        self._echo_s = {}

    def read(self, now: float) -> Mapping[str, float]:
        """Give the latest readings; see `Sensors.read`."""
        frames = self._parser.feed(self._heard())
        for frame in frames:
            self._take(frame, now)
        hall = {"distance": self._travel.distance, "speed": self._travel.speed(now)}
        return {**self._told(now, bool(frames)), **hall, "line": float(self._line)}

    def _take(self, frame: SerialFrame, now: float) -> None:
        for side in _SIDES:
            if units := getattr(frame, side):
                self._take_range(side, units * self._options.range_unit_m, now)
                self._echo_s[side] = now
            elif now - self._echo_s.setdefault(side, now) > _NO_ECHO_S:
                self._take_range(side, NO_ECHO_M, now)
        self._travel.take(frame.hall, now)
        self._line = frame.line
        self._take_battery(frame.battery * self._options.battery_unit_v)


class UcboardSensors(_SerialSensors):
    """Ranges, distance, speed and battery from the messages of the ucboard."""

    provided_readings = _ALL_RANGES | {"distance", "speed", "battery"}

    def __init__(self, options: UcboardSensorOptions, clock: Callable[[], float] = time.monotonic) -> None:
        """Open the port; see `_SerialSensors`."""
        super().__init__(options.port, options.baud, clock)
        self._parser = TextParser()
        self._hall = _CountedEdges(options.metres_per_tick, clock)

    def start(self) -> None:
        """Begin anew; see `Sensors.start`."""
        super().start()
        self._parser = TextParser()
        self._hall.start()

    def read(self, now: float) -> Mapping[str, float]:
        """Give the latest readings; see `Sensors.read`."""
        groups = self._parser.feed(self._heard())
        for group in groups:
            self._take(group, now)
        return {**self._told(now, bool(groups)), **self._hall.counter.read(now)}

    def _take(self, group: Mapping[str, float | None], now: float) -> None:
        for side, channel in zip(_SIDES, ("USL", "USF", "USR"), strict=True):
            if (tenths := group.get(channel)) is not None:
                self._take_range(side, tenths * 1e-4, now)
        if math.isfinite(count := _number(group.get("HALL_CNT"))):
            self._hall.take(int(count), group["HALL_DT"], now)
        if (millivolts := group.get("VDBAT")) is not None:
            self._take_battery(millivolts * 1e-3)


def _number(value: float | None) -> float:
    """A value, or inf where there is none."""
    return math.inf if value is None else value


class _Travel:
    """Distance and speed from a count of 16 bits that goes round."""

    def __init__(self, units_per_m: float) -> None:
        self._units_per_m = units_per_m
        self._count: int | None = None
        self._counted_s = 0.0
        self.distance = 0.0
        self._speed = WindowSpeed(_MAX_SPEED)

    def take(self, count: int, now: float) -> None:
        """Take a count. One that would need a speed that no car has is a garbled frame or a board that began anew."""
        if self._count is not None:
            way = (count - self._count) % 65536 / self._units_per_m
            if way <= _MAX_SPEED * (now - self._counted_s + _QUEUED_S):
                self.distance += way
        self._count, self._counted_s = count, now
        self._speed.take(self.distance, now)

    def speed(self, now: float) -> float:
        """Speed over the last counts, m/s."""
        return self._speed.speed(now)


class _CountedEdges:
    """Edges of a hall counter from a count of 8 bits and the time between the last two, in tenths of a millisecond."""

    def __init__(self, metres_per_tick: float, clock: Callable[[], float]) -> None:
        self.counter = HallCounter(HallConfig(metres_per_tick=metres_per_tick), clock)
        self._metres_per_tick = metres_per_tick
        self.start()

    def start(self) -> None:
        """Count from zero."""
        self.counter.start()
        self._count: int | None = None
        self._counted_s = self._stamp_s = -math.inf

    def take(self, count: int, spacing: float | None, now: float) -> None:
        """Take a count and a spacing.

        The spacing that the board measured places the edge behind the one before, if that comes near to the time at
        which the message was read: that time alone is coarser than the spacing. A count that would need a speed that no
        car has is garbled, or the board began anew.
        """
        new = 0 if self._count is None else (count - self._count) % 256
        possible = _MAX_SPEED * (now - self._counted_s + _QUEUED_S) / self._metres_per_tick if new else 0.0
        self._count, self._counted_s = count, now
        if new > possible:
            return
        spacing_s = _number(spacing) * 1e-4
        for _ in range(new):
            placed_s = self._stamp_s + spacing_s
            self._stamp_s = placed_s if abs(placed_s - now) <= _NEAR_S else now
            self.counter.edge(self._stamp_s)


_NEAR_S = 0.03
"""Messages are read at most so much later than they came: two control periods."""
