"""A person drives: the real car, or a simulated one in real time; recorded alike, so that a drive by hand is data."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError
from tral_env.hardware.bringup.preflight import Finding, check_car
from tral_env.hardware.car_file import CarFile, load_car
from tral_fsm.programs.car_drive import CarDrive, Console
from tral_fsm.programs.deploy import check_duration, finish, how_to_arm, preflight, prepare, require_hands
from tral_fsm.programs.seat import CarSeat, Course, Seat, SimulatedSeat, open_car
from tral_fsm.teleop.hands import Device
from tral_fsm.teleop.overseer import Overseer, Signals
from tral_fsm.teleop.pilot import Pilot
from tral_fsm.teleop.shaping import Shaping


@dataclass(frozen=True, kw_only=True)
class TeleopArguments:
    """Which car a person drives, as summary.json tells it."""

    config: str | None = None
    """Path of the car file; None: a simulated car."""
    course: Course | None = None
    """Which simulated car drives where; None: the real car."""
    dry: bool = False
    """Whether the pulses are only recorded."""
    max_duration_s: float = 600.0
    record: bool = True
    shaping: Shaping = field(default_factory=Shaping)

    def __post_init__(self) -> None:
        """Check the values."""
        if (self.config is None) == (self.course is None):
            raise ConfigError("expected either a car file (--config) or courses (--scenario), not both or none")
        if self.dry and self.course is not None:
            raise ConfigError("--dry beside --scenario or --course: a simulated car moves no motor, so leave --dry out")
        check_duration(self.max_duration_s)

    def car(self) -> CarFile | Course:
        """The content of the car file, or the course.

        Raises:
            ConfigError: the car file cannot be used.
        """
        if self.course is not None:
            return self.course
        assert self.config is not None, "one of both is given"
        return load_car(self.config)


def run(
    arguments: TeleopArguments,
    out: Path,
    devices: list[Device],
    console: Console,
    *,
    check: Callable[[CarFile], Sequence[Finding]] = check_car,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
    **options: Any,
) -> dict[str, Any]:
    """Drive once, and write summary.json, whose content this gives, and drive.mcap.

    Args:
        arguments: which car.
        out: folder of the files; those of an earlier drive are removed.
        devices: the first of them drives; each may arm, stop and end.
        console: where the drive tells what happens.
        check: looks at the real car before a drive that is no dry run.
        clock: clock of the drive, s.
        sleep: waits some seconds.
        options: more options of the car's environment, for a car without devices.

    Raises:
        ConfigError: a file cannot be used, or nobody has anything in hand.
        HardwareError: a device does not answer, or the pre-flight found a fault.
    """
    require_hands(devices, arm=False)
    car = arguments.car()
    if isinstance(car, CarFile):
        preflight(car, arguments, check, console)
    record = prepare(out, arguments.record)
    with Signals() as signals, contextlib.closing(_seat(arguments, car, record, clock, sleep, options)) as seat:
        overseer = Overseer(devices, clock, signals)
        drive = CarDrive(seat, Pilot(overseer, arguments.shaping), overseer, console, clock, sleep)
        return finish(asdict(arguments), out, drive, how_to_arm(devices, must_hold=False), record)


def _seat(
    arguments: TeleopArguments,
    car: CarFile | Course,
    record: Path | None,
    clock: Callable[[], float],
    sleep: Callable[[float], None],
    options: dict[str, Any],
) -> Seat:
    if isinstance(car, Course):
        return SimulatedSeat(car, record, clock, sleep, arguments.max_duration_s)
    return CarSeat(open_car(car, arguments, record, clock, sleep, options), {})
