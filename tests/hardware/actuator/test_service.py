"""The template of the service fits what the processes do."""

from configparser import ConfigParser
from pathlib import Path

from typer.main import get_command

import tral_env.hardware
from tral_env.hardware.actuator import client, rights
from tral_fsm.cli import app

UNIT = Path(tral_env.hardware.__path__[0]) / "systemd" / "tral-car.service"


def unit_file() -> ConfigParser:
    parser = ConfigParser(interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(UNIT, "utf-8")
    return parser


def service() -> dict[str, str]:
    return dict(unit_file()["Service"])


def test_it_starts_a_drive_that_only_a_person_with_the_gamepad_arms() -> None:
    program, name, *options = service()["ExecStart"].split()
    assert (Path(program).name, name) == ("tral", "deploy")
    deploy = get_command(app).commands[name]  # type: ignore[attr-defined]
    asked = deploy.make_context(name, options).params
    assert (asked["gamepad"], asked["arm"], asked["dry"]) == (True, False, False)
    assert set(service()["SupplementaryGroups"].split()) == {"i2c", "input"}


def test_no_boot_starts_it() -> None:
    assert unit_file().sections() == ["Unit", "Service"]


def test_the_keeper_may_feed_the_watchdog_and_nothing_restarts_the_car() -> None:
    unit = service()
    assert (unit["Type"], unit["NotifyAccess"], unit["Restart"]) == ("notify", "all", "no")
    assert float(unit["WatchdogSec"]) == 1.0


def test_the_last_line_ends_the_pulses_by_the_actuators_program() -> None:
    program = service()["ExecStopPost"].split()
    assert program[1:2] == ["-I"]
    assert program[2].endswith(str(Path(client.__file__).with_name("__main__.py").relative_to(UNIT.parents[3])))
    assert program[3:] == ["off", "1", "0x40"]


def test_the_limits_allow_what_the_processes_claim() -> None:
    unit = service()
    assert int(unit["LimitRTPRIO"]) >= rights.PRIORITY
    assert unit["LimitMEMLOCK"] == "infinity"
