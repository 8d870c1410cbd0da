"""A person drives: the real car, or a simulated one in real time; recorded alike, so that a drive by hand is data."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError
from tral_fsm.programs.car_drive import CarDrive, Console
from tral_fsm.programs.deploy import finish, how_to_arm, prepare, require_hands
from tral_fsm.programs.drive import RECORDING
from tral_fsm.programs.seat import CarSeat, Course, Seat, SimulatedSeat
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


def run(
    arguments: TeleopArguments,
    out: Path,
    devices: list[Device],
    console: Console,
    *,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
    **options: Any,
) -> dict[str, Any]:
    """Drive once, and write summary.json and drive.mcap.

    Args:
        arguments: which car.
        out: folder of the files; those of an earlier drive are removed.
        devices: the first of them drives; each may arm, stop and end.
        console: where the drive tells what happens.
        clock: clock of the drive, s.
        sleep: waits some seconds.
        options: more options of the car's environment, for a car without devices.

    Returns:
        The content of summary.json.

    Raises:
        ConfigError: a file cannot be used, or nobody has anything in hand.
        HardwareError: a device does not answer.
    """
    require_hands(devices, arm=False)
    prepare(out)
    record = out / RECORDING if arguments.record else None
    with Signals() as signals, contextlib.closing(_seat(arguments, record, clock, sleep, options)) as seat:
        overseer = Overseer(devices, clock, signals)
        drive = CarDrive(seat, Pilot(overseer, arguments.shaping), overseer, console, clock, sleep)
        return finish(asdict(arguments), out, drive, how_to_arm(devices, must_hold=False), record)


def _seat(
    arguments: TeleopArguments,
    record: Path | None,
    clock: Callable[[], float],
    sleep: Callable[[float], None],
    options: dict[str, Any],
) -> Seat:
    if arguments.course is not None:
        return SimulatedSeat(arguments.course, record, clock, sleep)
    from tral_env.hardware.env import TralCarEnv

    car = TralCarEnv(
        config=arguments.config,
        output="recorder" if arguments.dry else None,
        max_duration_s=arguments.max_duration_s,
        record=record,
        clock=clock,
        sleep=sleep,
        **options,
    )
    return CarSeat(car, {})
