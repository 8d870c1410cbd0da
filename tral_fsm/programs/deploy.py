"""A policy drives the real car: pre-flight, an explicit act that arms, a watched drive, a summary."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tral_env.checks import check_number
from tral_env.errors import ConfigError, HardwareError, problem_list
from tral_env.hardware.bringup.preflight import Finding, check_car
from tral_env.hardware.car_file import CarFile, load_car
from tral_env.interface import check_readings
from tral_fsm.live import require_viser
from tral_fsm.live.address import free_port
from tral_fsm.programs.car_drive import CarDrive, Console, report_of
from tral_fsm.programs.drive import RECORDING, SUMMARY
from tral_fsm.programs.seat import AskedOfCar, CarSeat, open_car
from tral_fsm.teleop.hands import Device
from tral_fsm.teleop.overseer import Overseer, Signals

if TYPE_CHECKING:
    from tral_fsm.live.car import CarPage


@dataclass(frozen=True, kw_only=True)
class DeployArguments:
    """What drives which car, as summary.json tells it."""

    policy: str
    """Name of a packaged machine, path of a machine file, folder of a trained policy, or FILE.py:NAME."""
    config: str
    """Path of the car file."""
    dry: bool = False
    """Whether the pulses are only recorded."""
    arm: bool = False
    """Whether it is armed without an act of a person."""
    max_duration_s: float = 60.0
    record: bool = True
    view: bool = False
    """Whether a page in the browser shows the drive, and can stop it."""
    host: str = "127.0.0.1"
    """Address that the page listens on."""
    port: int = 8080

    def __post_init__(self) -> None:
        """Check the values."""
        check_duration(self.max_duration_s)


def check_duration(max_duration_s: float) -> None:
    """Refuse a time limit that is none.

    Raises:
        ConfigError: it is no number above 0.
    """
    check_number("max_duration_s", max_duration_s, "s")
    if not max_duration_s > 0:
        raise ConfigError(f"max_duration_s = {max_duration_s!r}: expected a number above 0")


def require_hands(devices: list[Device], arm: bool) -> None:
    """Refuse to drive a car that nobody could arm or stop.

    Raises:
        ConfigError: there is neither a terminal nor a gamepad, and `--arm` was not given.
    """
    if not devices and not arm:
        raise ConfigError(
            "there is no terminal and no gamepad, so nobody could arm or stop the car: run it in a terminal, over ssh "
            "with `ssh -t`, or with --gamepad. --arm drives at once, and then only the signals SIGINT, SIGTERM and "
            "SIGHUP, the time limit and the switch of the motor stop it"
        )


def run(
    arguments: DeployArguments,
    out: Path,
    devices: list[Device],
    console: Console,
    *,
    must_hold: bool = False,
    check: Callable[[CarFile], Sequence[Finding]] = check_car,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
    **options: Any,
) -> dict[str, Any]:
    """Drive once, and write summary.json, whose content this gives, and drive.mcap.

    Args:
        arguments: what drives.
        out: folder of the files; those of an earlier drive are removed.
        devices: what a person arms and stops with.
        console: where the drive tells what happens.
        must_hold: whether the first device has a dead man's button that must be held.
        check: looks at the car before a drive that is no dry run.
        clock: clock of the drive, s.
        sleep: waits some seconds.
        options: more options of the car's environment, for a car without devices.

    Raises:
        ConfigError: a file cannot be used, the car lacks a reading, or nobody could stop it.
        HardwareError: a device does not answer, or the pre-flight found a fault.
        PolicyError: the policy failed; the car was stopped.
    """
    require_hands(devices, arguments.arm)
    if arguments.view:
        require_viser()
        free_port(arguments.host, arguments.port)
    car, (policy, files) = load_car(arguments.config), _policy(arguments.policy)
    preflight(car, arguments, check, console)
    record = prepare(out, arguments.record)
    with contextlib.ExitStack() as stack:
        signals = stack.enter_context(Signals())
        env = stack.enter_context(contextlib.closing(open_car(car, arguments, record, clock, sleep, options)))
        check_readings(policy, env)
        page = stack.enter_context(contextlib.closing(_page(arguments, policy))) if arguments.view else None
        overseer = Overseer([*devices, *([] if page is None else [page])], clock, signals, must_hold=must_hold)
        show = None if page is None else page.show
        drive = CarDrive(CarSeat(env, files), policy, overseer, console, clock, sleep, show)
        return finish(asdict(arguments), out, drive, "" if arguments.arm else how_to_arm(devices, must_hold), record)


def _page(arguments: DeployArguments, policy: Any) -> CarPage:
    """The page of a drive, in a process of its own."""
    from tral_fsm.live.car import CarPage

    return CarPage(policy, arguments.policy, arguments.host, arguments.port)


def _policy(name: str) -> tuple[Any, dict[str, bytes]]:
    """A policy by its name, and its files for the recording."""
    from tral_fsm.evaluation.own_policy import find_policy
    from tral_fsm.evaluation.policy_files import files_of_policy

    policy = find_policy(name)
    return policy, files_of_policy(name, policy)


def preflight(car: CarFile, asked: AskedOfCar, check: Callable[[CarFile], Sequence[Finding]], console: Console) -> None:
    """Look at a car before a drive, unless that is a dry run, and tell what was found.

    Raises:
        HardwareError: something is wrong.
    """
    if asked.dry:
        return
    findings = check(car)
    for each in findings:
        console.say(f"pre-flight, {each.what}: {each.problem or each.told or 'ok'}")
    if problems := [f"{each.what}: {each.problem}" for each in findings if each.problem]:
        raise HardwareError(problem_list("the pre-flight refuses this car:", problems))


def how_to_arm(devices: list[Device], must_hold: bool) -> str:
    """What a person has to do."""
    ways = ["r on the keyboard" if device.name == "keyboard" else "start on the gamepad" for device in devices]
    first = "hold LB, the dead man's button, and press" if must_hold else "press"
    stop = " Any other key stops the car." if any(device.name == "keyboard" for device in devices) else ""
    return f"To arm, {first} {' or '.join(ways)}; q or back ends.{stop}"


def prepare(out: Path, has_recording: bool) -> Path | None:
    """Make the folder, and remove the files of an earlier drive; gives the path of the recording, if there is one."""
    from tral_fsm.evaluation.files import prepare_folder

    prepare_folder(out)
    for name in (SUMMARY, RECORDING):
        (out / name).unlink(missing_ok=True)
    return out / RECORDING if has_recording else None


def finish(
    arguments: Mapping[str, Any], out: Path, drive: CarDrive, arming: str, record: Path | None
) -> dict[str, Any]:
    """Drive, and write the summary; it says so where the policy failed, before that error goes on."""
    from tral_fsm.evaluation.files import write_json
    from tral_fsm.teleop.overseer import End

    end = End("an error of the program", failed=True)
    try:
        end = drive.run(arming)
    except Exception as error:
        end = End(f"{type(error).__name__}: {error}", failed=True)
        raise
    finally:
        recording = record.name if record is not None and drive.tally.ends_s else ""
        report = report_of(arguments, drive.tally, end, recording)
        write_json(out / SUMMARY, report)
    return report
