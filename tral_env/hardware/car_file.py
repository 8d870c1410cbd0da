"""The car file ``car.toml``: the board, its pulses, sensors, camera, limits and battery of one car."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from tral_env import json_text, toml_text
from tral_env.calibration.camera_info import LENSES
from tral_env.errors import BadFileError, CalibrationError, ConfigError, UnreadableCarError
from tral_env.hardware.actuator.drivers import BoardOptions, board_class
from tral_env.hardware.actuator.options import check_quantities, quantity
from tral_env.hardware.actuator.settings import Limits, Settings
from tral_env.hardware.calibration_file import calibration_problems, load_calibration
from tral_env.hardware.camera_options import CameraOptions
from tral_env.hardware.faults import FaultLimits
from tral_env.hardware.pulses import CarCalibration
from tral_env.hardware.sensor_drivers import SensorOptions, sensor_class
from tral_env.hardware.tables import Tables
from tral_env.toml_text import Path_, TomlText

VERSION = 1
STEPS = ("clock", "neutral", "ends", "direction", "dead_zone", "arming", "hall", "sonars", "camera")
"""Steps of the guided calibration; a car file says on which day each was done."""
_CLOCK_KEYS = ("period_us", "oscillator_hz", "clock_measured")
"""The table [board] may say these; else they come from the file of the pulses."""
NO_SENSORS = "none"


class Board(NamedTuple):
    """A board by name, and its options."""

    driver: str
    options: BoardOptions


class Sensor(NamedTuple):
    """Sensors by the name of their driver, and their options."""

    driver: str
    options: SensorOptions


@dataclass(frozen=True, kw_only=True)
class BatteryLimits:
    """When the voltage of the drive battery is low. Source: NiMH pack of 6 cells, 1.1 V and 1.0 V a cell."""

    warn_v: float = quantity(6.6, 1.0, 60.0, "V")
    """Below this voltage a person is told, V."""
    stop_v: float = quantity(6.0, 1.0, 60.0, "V")
    """Below this voltage the car stops, V."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_quantities(self)
        if not self.stop_v < self.warn_v:
            raise ConfigError(f"stop_v = {self.stop_v:g} V is not below warn_v = {self.warn_v:g} V")


@dataclass(frozen=True, kw_only=True)
class CarFile:
    """One car, as its file tells it."""

    name: str
    """Which car this is."""
    board: Board
    """What makes the pulses."""
    calibration: CarCalibration
    """The pulses of this car, and the clock of its board."""
    sensors: tuple[Sensor, ...] = ()
    camera: CameraOptions | None = None
    limits: Limits = field(default_factory=Limits)
    """When the actuator's process stops the car."""
    battery: BatteryLimits = field(default_factory=BatteryLimits)
    faults: FaultLimits = field(default_factory=FaultLimits)
    """When the drive itself notices a fault; what the battery may fall to stands in `battery`."""
    calibrated: Mapping[str, date] = field(default_factory=dict)
    """Steps of the calibration that were done, each with its day; see `STEPS`."""

    @property
    def settings(self) -> Settings:
        """What the actuator's process is told."""
        steering, throttle = self.calibration.laws
        options: Any = self.board.options
        return Settings(
            driver=self.board.driver,
            bus=options.device,
            address=getattr(options, "address", Settings.address),
            options=asdict(options),
            period_us=self.calibration.period_us,
            oscillator_hz=self.calibration.oscillator_hz,
            steering=steering,
            throttle=throttle,
            limits=self.limits,
        )

    def fault_limits(self, given: FaultLimits | None = None) -> FaultLimits:
        """When a fault counts for this car.

        Args:
            given: counts instead of `faults`; None: nothing was given. A voltage that it leaves at its default is that
                of `battery`.
        """
        limits, default = self.faults if given is None else given, FaultLimits()
        low_v, empty_v = limits.battery_low_v, limits.battery_empty_v
        return replace(
            limits,
            battery_low_v=self.battery.warn_v if low_v == default.battery_low_v else low_v,
            battery_empty_v=self.battery.stop_v if empty_v == default.battery_empty_v else empty_v,
        )

    @property
    def clock_is_known(self) -> bool:
        """Whether the lengths of the pulses are known: neutral of a board that was not measured may drive the motor."""
        return self.calibration.clock_measured or not self.board.options.has_own_clock


def load_car(source: str | Path | CarFile) -> CarFile:
    """Read a car file.

    Args:
        source: path of a TOML file, or a car, which is given back.

    Raises:
        BadFileError: the file cannot be read, is no TOML, or is no car; the message lists every problem with its line.
    """
    if isinstance(source, CarFile):
        return source
    return parse_car(read_car_text(source), str(source), Path(source).parent)


def read_car_text(path: str | Path) -> str:
    """Read the text of a car file.

    Args:
        path: of the file.

    Raises:
        UnreadableCarError: the file cannot be read.
    """
    try:
        return json_text.read(path)
    except (OSError, UnicodeDecodeError) as error:
        told = f"cannot read '{path}': {json_text.unread(error)}. `tral car init` writes a car file to begin with"
        raise UnreadableCarError(told) from error


def parse_car(text: str, where: str = "car.toml", folder: Path = Path()) -> CarFile:
    """Read a car from TOML text.

    Args:
        text: TOML.
        where: name of the file in error messages.
        folder: paths in the text begin here.

    Raises:
        BadFileError: see `load_car`.
    """
    return _car(toml_text.parse(text, where, BadFileError), folder)


@dataclass(frozen=True, kw_only=True)
class _Root:
    """The keys outside of tables."""

    version: int
    name: str


_TABLES = ("board", "pulses", "sensors", "camera", "limits", "battery", "faults", "calibrated")


def _car(text: TomlText, folder: Path) -> CarFile:
    content, tables = text.content, Tables(text)
    plain = {name: value for name, value in content.items() if name not in _TABLES}
    root = tables.build(_Root, (), plain, _TABLES)
    if root is not None and root.version != VERSION:
        tables.refuse(("version",), f"got {root.version}, expected {VERSION}")
    for name in ("board", "pulses"):
        if name not in content:
            tables.refuse_missing((), name)
    name = root.name if root is not None else "car"
    values = {
        "board": _board(tables, content.get("board", {})),
        "calibration": _pulses(tables, content.get("pulses", {}), content.get("board", {}), name, folder),
        "sensors": _sensors(tables, content.get("sensors", [])),
        "limits": _switched(tables, Limits, ("limits",), content.get("limits", {})),
        "faults": _faults(tables, content.get("faults", {})),
        "battery": _section(tables, BatteryLimits, ("battery",), content.get("battery", {})),
        "camera": _camera(tables, content["camera"], folder) if "camera" in content else None,
        "calibrated": _calibrated(tables, content.get("calibrated", {})),
    }
    _refuse_together(tables, values)
    tables.finish()
    return CarFile(name=name, **values)


def _section(tables: Tables, kind: type[Any], path: Path_, value: Any) -> Any:
    table = tables.table(path, value)
    return None if table is None else tables.build(kind, path, table)


def _board(tables: Tables, value: Any) -> Board | None:
    if not value or (table := tables.table(("board",), value)) is None:
        return None
    rest = {name: item for name, item in table.items() if name not in _CLOCK_KEYS}
    board: Board | None = _driven(tables, ("board",), rest, board_class, Board, _CLOCK_KEYS)
    return board


def _driven(
    tables: Tables, path: Path_, table: dict[str, Any], find: Any, kind: Any, given: tuple[str, ...] = ()
) -> Any:
    """A board or a sensor: its driver by name, and the options of that driver."""
    driver = table.pop("driver", None)
    if not isinstance(driver, str):
        tables.refuse_missing(path, "driver")
        return None
    try:
        found = find(driver)
    except ConfigError as error:
        tables.refuse((*path, "driver"), str(error))
        return None
    options = tables.build(found, path, table, ("driver", *given))
    return None if options is None else kind(driver, options)


def _sensors(tables: Tables, value: Any) -> tuple[Sensor, ...]:
    if value == NO_SENSORS:
        return ()
    if not isinstance(value, list):
        tables.refuse(("sensors",), f'got {value!r}, expected a list of tables, [[sensors]], or "{NO_SENSORS}"')
        return ()
    found = []
    for number, item in enumerate(value):
        path: Path_ = ("sensors", number)
        if (table := tables.table(path, item)) is not None:
            found.append(_driven(tables, path, dict(table), sensor_class, Sensor))
    return tuple(found)


def _switched(tables: Tables, kind: type[Any], path: Path_, value: Any) -> Any:
    """Limits from a table; "off" switches a law off whose limit may be None."""
    if (table := tables.table(path, value)) is None:
        return None
    optional = {each.name for each in fields(kind) if "None" in str(each.type)}
    off = {name: None for name in optional if table.get(name) == "off"}
    limits = tables.build(kind, path, {name: item for name, item in table.items() if name not in off})
    return None if limits is None else replace(limits, **off)


def _faults(tables: Tables, value: Any) -> Any:
    """When a fault counts; the two voltages stand in [battery]."""
    for name, own in (("battery_low_v", "warn_v"), ("battery_empty_v", "stop_v")):
        if isinstance(value, dict) and name in value:
            tables.refuse(("faults", name), f"stands in [battery], as {own}")
    return _switched(tables, FaultLimits, ("faults",), value)


def _refuse_together(tables: Tables, values: Mapping[str, Any]) -> None:
    """Note what is allowed alone, and would stop every drive, or never stop a blind one, together."""
    camera, faults, limits = values["camera"], values["faults"], values["limits"]
    if limits is not None and limits.evidence_s is None and values["sensors"]:
        tables.refuse(("limits", "evidence_s"), '"off" is for a car without sensors, and this one has [[sensors]]')
    if faults is None:
        return
    if camera is not None and faults.image_s is not None and camera.oldest_s >= faults.image_s:
        tables.refuse(
            ("camera",),
            f"with rate_hz = {camera.rate_hz:g} and latency_s = {camera.latency_s:g} the newest image gets "
            f"{camera.oldest_s:.2f} s old, and image_s = {faults.image_s:g} s would stop every drive: choose a faster "
            "camera, or raise image_s in [faults]",
        )
    for number, sensor in enumerate(values["sensors"]):
        oldest_s = getattr(getattr(sensor, "options", None), "oldest_s", 0.0)
        if faults.silent_s is not None and oldest_s >= faults.silent_s:
            tables.refuse(
                ("sensors", number),
                f"a range gets {oldest_s:.2f} s old with this cadence_s and firing, and silent_s = {faults.silent_s:g} "
                "s would stop every drive: choose a shorter cadence_s, or raise silent_s in [faults]",
            )


def _camera(tables: Tables, value: Any, folder: Path) -> CameraOptions | None:
    camera: CameraOptions | None = _section(tables, CameraOptions, ("camera",), value)
    if camera is None or not camera.lens or camera.lens in LENSES:
        return camera
    return replace(camera, lens=str(folder / camera.lens))


def _calibrated(tables: Tables, value: Any) -> Mapping[str, date]:
    if (table := tables.table(("calibrated",), value)) is None:
        return {}
    tables.known(("calibrated",), table, STEPS)
    for name, day in table.items():
        if type(day) is not date:
            tables.refuse(("calibrated", name), f"got {day!r}, expected a day such as 2026-05-01")
    return dict(table)


def _pulses(tables: Tables, value: Any, board: Any, name: str, folder: Path) -> CarCalibration | None:
    """The calibration: a file by name or path, the values that stand beside it, and the clock of the board."""
    if not value or (table := tables.table(("pulses",), value)) is None or not isinstance(board, dict):
        return None
    content: dict[str, Any] = {"version": 1}
    if "file" in table:
        try:
            source = str(table["file"])
            content = load_calibration(folder / source if source.endswith(".json") else source).model_dump()
        except CalibrationError as error:
            tables.refuse(("pulses", "file"), str(error))
            return None
    tables.known(("pulses",), table, ("file", "steering", "throttle"))
    for part in ("steering", "throttle"):
        inner = table.get(part, {})
        if tables.table(("pulses", part), inner) is not None and (inner or part not in content):
            content[part] = {**content.get(part, {}), **inner}
    content |= {key: board[key] for key in _CLOCK_KEYS if key in board} | {"name": name}
    content.pop("schema_", None)
    try:
        return CarCalibration.model_validate(content)
    except ValidationError as error:
        for path, problem in calibration_problems(error):
            inner_path = ("board", *path) if path and path[0] in _CLOCK_KEYS else ("pulses", *path)
            tables.refuse(inner_path, problem.partition(": ")[2] or problem)
    return None
