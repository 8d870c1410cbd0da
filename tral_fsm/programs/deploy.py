"""A policy drives the real car: pre-flight, an explicit act that arms, a watched drive, a summary."""

from __future__ import annotations

import contextlib
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from tral_env.hardware.car_file import load_car
from tral_env.interface import check_readings
from tral_fsm.live import require_viser
from tral_fsm.live.address import free_port
from tral_fsm.programs.car_drive import CarDrive
from tral_fsm.programs.cockpit import Cockpit, check_duration
from tral_fsm.programs.seat import CarSeat
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


def run(arguments: DeployArguments, cockpit: Cockpit) -> dict[str, Any]:
    """Drive once, and write summary.json, whose content this gives, and drive.mcap.

    Raises:
        ConfigError: a file cannot be used, the car lacks a reading, or nobody could stop it.
        HardwareError: a device does not answer, or the pre-flight found a fault.
        PolicyError: the policy failed; the car was stopped.
    """
    how_to_arm = _how_to_arm(arguments, cockpit)
    if arguments.view:
        require_viser()
        free_port(arguments.host, arguments.port)
    car, (policy, files) = load_car(arguments.config), _policy(arguments.policy)
    cockpit.preflight(car, arguments)
    record = cockpit.prepare(arguments.record)
    with contextlib.ExitStack() as stack:
        signals = stack.enter_context(Signals())
        env = stack.enter_context(contextlib.closing(cockpit.open_car(car, arguments, record)))
        check_readings(policy, env)
        page = stack.enter_context(contextlib.closing(_page(arguments, policy))) if arguments.view else None
        devices = [*cockpit.devices, *([] if page is None else [page])]
        overseer = Overseer(devices, cockpit.clock, signals, must_hold=cockpit.must_hold)
        show = None if page is None else page.show
        seat = CarSeat(env, files)
        drive = CarDrive(seat, policy, overseer, cockpit.console, cockpit.clock, cockpit.sleep, show)
        return cockpit.finish(asdict(arguments), drive, how_to_arm, record)


def _how_to_arm(arguments: DeployArguments, cockpit: Cockpit) -> str:
    """What a person has to do; empty: the car is armed at once.

    A dry run moves no motor, so it needs nobody who could stop one.

    Raises:
        ConfigError: there is neither a terminal nor a gamepad, and the motor would be let go.
    """
    if arguments.arm or (arguments.dry and not cockpit.devices):
        return ""
    cockpit.require_hands(
        "--arm drives at once, and then only the signals SIGINT, SIGTERM and SIGHUP, the time limit and the switch of "
        "the motor stop it"
    )
    return cockpit.how_to_arm()


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
