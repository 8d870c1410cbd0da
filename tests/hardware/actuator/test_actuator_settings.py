"""Limits that cannot be are refused by name; settings survive the command line."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rig import SETTINGS, STEERING, THROTTLE, settings

from tral_env.errors import ConfigError
from tral_env.hardware.actuator.drivers import BOARDS, open_driver
from tral_env.hardware.actuator.settings import Limits, Settings


def test_settings_survive_the_command_line() -> None:
    given = settings(brake=-0.5, evidence_s=0.7)
    assert Settings.from_json(given.to_json()) == given
    assert Settings.from_json(SETTINGS.to_json()) == SETTINGS


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        ({"silence_s": math.nan}, "silence_s = nan: expected 0.02 to 0.5 s"),
        ({"silence_s": None}, "silence_s = None"),
        ({"arming_s": True}, "arming_s = True"),
        ({"brake": 0.1}, r"brake = 0.1: expected -1 to 0"),
        ({"max_throttle": 1.1}, "max_throttle = 1.1: expected 0 to 1"),
        ({"silence_s": 10.0}, "silence_s = 10.0: expected 0.02 to 0.5"),
        ({"evidence_s": 0.0}, "evidence_s = 0.0: expected 0.05 to 5"),
        ({"silence_s": 0.5}, "off_s = 0.5 is not above silence_s = 0.5"),
        ({"max_age_s": 0.15}, "max_age_s = 0.15 is above silence_s = 0.1"),
        ({"max_age_s": 60.0}, "max_age_s = 60.0: expected 0.005 to 0.5"),
        ({"bus_s": 60.0}, "bus_s = 60.0: expected 0.005 to 0.5"),
        ({"check_s": 60.0}, "check_s = 60.0: expected 0.02 to 1"),
        ({"off_s": 5.0}, "off_s = 5.0: expected 0.02 to 2"),
        ({"hang_s": 1.0}, "hang_s = 1.0: expected 0.03 to 0.5"),
    ],
)
def test_limits_that_cannot_be_are_refused(limits: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        Limits(**limits)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"throttle": THROTTLE._replace(output=5)}, "outputs 0 and 5 are not neighbours"),
        ({"throttle": THROTTLE._replace(output=-1)}, "throttle: output -1, expected 0 to 15"),
        ({"throttle": THROTTLE._replace(centre_us=math.nan)}, "pulses 1900, nan, 1100 us do not lie"),
        ({"throttle": THROTTLE._replace(centre_us=1100.0)}, "pulses 1900, 1100, 1100 us do not lie"),
        ({"steering": STEERING._replace(plus_us=1200.0)}, "steering: pulses 1810, 1530, 1200 us do not lie"),
        ({"steering": STEERING._replace(max_us=math.inf)}, "steering: limits 1240 to inf us, expected within"),
        ({"throttle": THROTTLE._replace(dead_zone_us=-1.0)}, "rests within -1 us"),
        ({"throttle": THROTTLE._replace(skip_us=math.nan)}, "skips nan us"),
        ({"throttle": THROTTLE._replace(slew_per_s=0.0)}, "slew 0 per s, expected above 0"),
        ({"address": 0x78}, "address = 120, expected 8 to 119"),
        ({"period_us": 100}, "period_us = 100, expected 4000 to 34000"),
        ({"oscillator_hz": math.nan}, "oscillator_hz = nan"),
        (
            {"throttle": THROTTLE._replace(dead_zone_us=0.0), "limits": Limits(brake=-1.0)},
            r"brake is below 0, and the calibration has no throttle\.dead_zone_us",
        ),
    ],
)
def test_settings_that_cannot_be_are_refused(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        replace(SETTINGS, **changes)


def test_a_driver_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ConfigError, match=f"unknown driver 'relay', expected {', '.join(BOARDS)}"):
        open_driver(Settings(**{**vars(SETTINGS), "driver": "relay"}))


def test_the_driver_log_writes_pulses_within_the_limits(tmp_path: Path) -> None:
    driver = open_driver(replace(SETTINGS, bus=str(tmp_path / "log")))
    driver.start()
    driver.set_pulses(0.0, 9999.0)
    driver.off()
    assert driver.check() == ""
    rows = [line.split()[1:] for line in (tmp_path / "log").read_text().splitlines()]
    assert rows == [["1530", "1500"], ["1240", "1900"], ["0", "0"]]
