"""The template of the service fits what the processes do."""

from configparser import ConfigParser
from pathlib import Path

import tral_env.hardware
from tral_env.hardware.actuator import client, rights

UNIT = Path(tral_env.hardware.__path__[0]) / "systemd" / "tral-car.service"


def service() -> dict[str, str]:
    parser = ConfigParser(interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(UNIT, "utf-8")
    return dict(parser["Service"])


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
