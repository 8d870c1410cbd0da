"""Limits that cannot be are refused by name; settings survive the command line."""

import math
from typing import Any

import pytest
from rig import SETTINGS, settings

from tral_env.errors import ConfigError
from tral_env.hardware.actuator.drivers import DRIVERS, open_driver
from tral_env.hardware.actuator.settings import Limits, Settings


def test_settings_survive_the_command_line() -> None:
    given = settings(brake=-0.5, evidence_s=0.7)
    assert Settings.from_json(given.to_json()) == given
    assert Settings.from_json(SETTINGS.to_json()) == SETTINGS


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        ({"silence_s": math.nan}, "silence_s = nan, expected a finite number"),
        ({"silence_s": None}, "silence_s = None"),
        ({"arming_s": True}, "arming_s = True"),
        ({"brake": 0.1}, r"brake = 0.1, expected -1 to 0"),
        ({"max_throttle": 1.1}, "max_throttle = 1.1, expected 0 to 1"),
        ({"silence_s": 10.0}, "silence_s = 10.0, expected 0.02 to 1"),
        ({"evidence_s": 0.0}, "evidence_s = 0.0, expected 0.001 to 60"),
        ({"silence_s": 0.5}, "off_s = 0.5 is not above silence_s = 0.5"),
    ],
)
def test_limits_that_cannot_be_are_refused(limits: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        Limits(**limits)


def test_a_driver_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ConfigError, match=f"unknown driver 'relay', expected {', '.join(DRIVERS)}"):
        open_driver(Settings(**{**vars(SETTINGS), "driver": "relay"}))
