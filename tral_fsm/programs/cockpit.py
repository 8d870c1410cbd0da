"""What a drive in a car has around it, whoever drives: devices in people's hands, files, console, clock, pre-flight."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tral_env.checks import check_number
from tral_env.errors import ConfigError, HardwareError, problem_list
from tral_env.hardware.bringup.preflight import Finding, check_car
from tral_env.hardware.car_file import CarFile
from tral_fsm.programs.car_drive import CarDrive, Console, report_of
from tral_fsm.programs.drive import RECORDING, SUMMARY
from tral_fsm.programs.seat import AskedOfCar, open_car
from tral_fsm.teleop.hands import Device

if TYPE_CHECKING:
    from tral_env.hardware.env import TralCarEnv


def check_duration(max_duration_s: float) -> None:
    """Refuse a time limit that is none.

    Raises:
        ConfigError: it is no number above 0.
    """
    check_number("max_duration_s", max_duration_s, "s")
    if not max_duration_s > 0:
        raise ConfigError(f"max_duration_s = {max_duration_s!r}: expected a number above 0")


@dataclass(frozen=True, kw_only=True)
class Cockpit:
    """What `tral deploy` and `tral teleop` take beside their arguments."""

    out: Path
    """Folder of the files; those of an earlier drive are removed."""
    devices: Sequence[Device]
    """What people have in hand: each may arm, stop and end. Where a person drives, the first one does."""
    console: Console
    """Where the drive tells what happens."""
    must_hold: bool = False
    """Whether the first device has a dead man's button that must be held."""
    check: Callable[[CarFile], Sequence[Finding]] = check_car
    """Looks at the real car before a drive that is no dry run."""
    clock: Callable[[], float] = time.monotonic
    """Clock of the drive, s."""
    sleep: Callable[[float], None] = time.sleep
    """Waits some seconds."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """More options of the car's environment, for a car without devices."""

    def require_hands(self, otherwise: str = "") -> None:
        """Refuse a drive that nobody could arm or stop.

        Args:
            otherwise: a sentence about another way; empty: there is none.

        Raises:
            ConfigError: there is neither a terminal nor a gamepad.
        """
        if not self.devices:
            raise ConfigError(
                "there is no terminal and no gamepad, so nobody could arm or stop the car: run it in a terminal, over "
                f"ssh with `ssh -t`, or with --gamepad. {otherwise}".strip()
            )

    def how_to_arm(self) -> str:
        """What a person has to do."""
        is_keyboard = [device.name == "keyboard" for device in self.devices]
        ways = ["r on the keyboard" if keys else "start on the gamepad" for keys in is_keyboard]
        first = "hold LB, the dead man's button, and press" if self.must_hold else "press"
        stop = " Any other key stops the car." if any(is_keyboard) else ""
        return f"To arm, {first} {' or '.join(ways)}; q or back ends.{stop}"

    def preflight(self, car: CarFile, asked: AskedOfCar) -> None:
        """Look at a car before a drive, unless that is a dry run, and tell what was found.

        Raises:
            HardwareError: something is wrong.
        """
        if asked.dry:
            return
        findings = self.check(car)
        for each in findings:
            self.console.say(f"pre-flight, {each.what}: {each.problem or each.told or 'ok'}")
        if problems := [f"{each.what}: {each.problem}" for each in findings if each.problem]:
            raise HardwareError(problem_list("the pre-flight refuses this car:", problems))

    def open_car(self, car: CarFile, asked: AskedOfCar, record: Path | None) -> TralCarEnv:
        """Open the real car; see `tral_fsm.programs.seat.open_car`."""
        return open_car(car, asked, record, self.clock, self.sleep, self.options)

    def prepare(self, has_recording: bool) -> Path | None:
        """Make the folder, and remove the files of an earlier drive.

        Returns:
            Path of the recording, if there is to be one.
        """
        from tral_fsm.evaluation.files import prepare_folder

        prepare_folder(self.out)
        for name in (SUMMARY, RECORDING):
            (self.out / name).unlink(missing_ok=True)
        return self.out / RECORDING if has_recording else None

    def finish(
        self, arguments: Mapping[str, Any], drive: CarDrive, how_to_arm: str, record: Path | None
    ) -> dict[str, Any]:
        """Drive, and write the summary; it says so where the policy failed, before that error goes on.

        Args:
            arguments: as summary.json tells them.
            drive: the drive.
            how_to_arm: what a person has to do; empty: it is armed already.
            record: path of the recording, if there is one.

        Returns:
            The content of the summary.
        """
        from tral_fsm.evaluation.files import write_json
        from tral_fsm.teleop.overseer import End

        def write(end: End) -> dict[str, Any]:
            recording = record.name if record is not None and drive.tally.ends_s else ""
            report = report_of(arguments, drive.tally, end, recording)
            write_json(self.out / SUMMARY, report)
            return report

        try:
            end = drive.run(how_to_arm)
        except BaseException as error:
            told = f"{type(error).__name__}: {error}" if isinstance(error, Exception) else "an error of the program"
            try:
                write(End(told, failed=True))
            except OSError as second:  # what the policy did wrong is not hidden by a full disk
                error.add_note(f"The summary could not be written either: {second}")
            raise
        return write(end)
