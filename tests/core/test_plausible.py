"""Numbers that no car has are refused, and the error asks for the unit that was likely meant."""

from typing import Any

import pytest

from tral_env import config
from tral_env.config import (
    CameraConfig,
    CarConfig,
    EscConfig,
    HallConfig,
    ServoConfig,
    TaskConfig,
    UltrasonicConfig,
    check_plausible,
)
from tral_env.errors import ConfigError
from tral_env.randomization import LEVELS, Randomization


@pytest.mark.parametrize(
    ("kind", "field", "value", "told"),
    [
        (HallConfig, "metres_per_tick", 25.13, "= 25.13 m: expected 0.0001 to 1 m; is it in mm or cm\\?"),
        (HallConfig, "timeout_s", 250.0, "expected 0.01 to 10 s; is it in ms\\?"),
        (CameraConfig, "marker_size", 180, "= 180 m: expected 0.005 to 2 m; is it in mm or cm\\?"),
        (UltrasonicConfig, "cadence_s", 65, "= 65 s: expected 0.001 to 5 s; is it in ms\\?"),
        (UltrasonicConfig, "jitter_share", 30.0, "a share between 0 and 1; is it in %\\?"),
        (EscConfig, "battery_v", 7200, "= 7200 V: expected 1 to 60 V; is it in mV\\?"),
        (CarConfig, "full_lock_deg", 0.384, "= 0.384 deg: expected 1 to 80 deg; is it in rad\\?"),
        (CarConfig, "wheelbase", 257, "is it in mm or cm\\?"),
        (CarConfig, "mass", 1900.0, "is it in g\\?"),
        (ServoConfig, "speed", 320.0, "is it in deg/s\\?"),
        (TaskConfig, "touch_speed", 50.0, "is it in mm/s or km/h\\?"),
        (Randomization, "battery_v", (6800.0, 8200.0), "is it in mV\\?"),
        (Randomization, "sonar_cadence_s", (65.0, 75.0), "is it in ms\\?"),
        (Randomization, "latency_s", (10.0, 40.0), "at most 0.2 s; is it in ms\\?"),
        (Randomization, "friction", (70.0, 110.0), "is it in %\\?"),
        (Randomization, "hall_miss_rate", (0.0, 5.0), "is it in %\\?"),
    ],
)
def test_a_number_in_another_unit_is_refused(kind: Any, field: str, value: Any, told: str) -> None:
    with pytest.raises(ConfigError, match=f"{kind.__name__}.{field} .*{told}"):
        kind(**{field: value})


def test_a_number_that_no_unit_explains_is_refused_without_a_guess() -> None:
    with pytest.raises(ConfigError, match=r"^here = 1e\+09 m: expected 0 to 2 m$"):
        check_plausible("here", 1e9, 0.0, 2.0, "m")


def test_what_the_project_itself_uses_is_plausible() -> None:
    for kind in (config.LineConfig, config.ImuConfig, CameraConfig, CarConfig, HallConfig, UltrasonicConfig):
        kind()
    assert set(LEVELS) == {"none", "default", "hard"}
