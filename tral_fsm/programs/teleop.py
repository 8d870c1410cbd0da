"""A person drives: the real car, or a simulated one in real time; recorded alike, so that a drive by hand is data."""

from __future__ import annotations

import contextlib
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError
from tral_env.hardware.car_file import CarFile, load_car
from tral_fsm.programs.car_drive import CarDrive
from tral_fsm.programs.cockpit import Cockpit, check_duration
from tral_fsm.programs.seat import CarSeat, Course, Seat, SimulatedSeat
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


def run(arguments: TeleopArguments, cockpit: Cockpit) -> dict[str, Any]:
    """Drive once, and write summary.json, whose content this gives, and drive.mcap.

    Raises:
        ConfigError: a file cannot be used, or nobody has anything in hand.
        HardwareError: a device does not answer, or the pre-flight found a fault.
    """
    cockpit.require_hands()
    car = arguments.car()
    if isinstance(car, CarFile):
        cockpit.preflight(car, arguments)
    record = cockpit.prepare(arguments.record)
    with Signals() as signals, contextlib.closing(_seat(arguments, car, record, cockpit)) as seat:
        overseer = Overseer(cockpit.devices, cockpit.clock, signals)
        pilot = Pilot(overseer, arguments.shaping)
        drive = CarDrive(seat, pilot, overseer, cockpit.console, cockpit.clock, cockpit.sleep)
        return cockpit.finish(asdict(arguments), drive, cockpit.how_to_arm(), record)


def _seat(arguments: TeleopArguments, car: CarFile | Course, record: Path | None, cockpit: Cockpit) -> Seat:
    if isinstance(car, Course):
        return SimulatedSeat(car, record, cockpit.clock, cockpit.sleep, arguments.max_duration_s)
    return CarSeat(cockpit.open_car(car, arguments, record), {})
