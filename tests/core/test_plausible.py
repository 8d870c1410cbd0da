"""Numbers that no car has are refused, and the error asks for the unit that was likely meant."""

import math
from typing import Any

import numpy as np
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
        (UltrasonicConfig, "corner_tolerance", 1.0, "= 1: expected 0 to 0.9"),
        (UltrasonicConfig, "corner_tolerance", 15, "expected 0 to 0.9; is it in %\\?"),
        (CameraConfig, "rate_hz", 81.0, "= 81 Hz: expected 0.1 to 80 Hz"),
        (UltrasonicConfig, "jitter_share", 30.0, "a share between 0 and 1; is it in %\\?"),
        (EscConfig, "battery_v", 7200, "= 7200 V: expected 1 to 60 V; is it in mV\\?"),
        (CarConfig, "full_lock_deg", 0.384, "= 0.384 deg: expected 1 to 80 deg; is it in rad\\?"),
        (CarConfig, "wheelbase", 257, "is it in mm or cm\\?"),
        (CarConfig, "mass", 1900.0, "is it in g\\?"),
        (ServoConfig, "speed", 320.0, "is it in deg/s\\?"),
        (TaskConfig, "touch_speed", 50.0, "is it in mm/s or km/h\\?"),
        (Randomization, "battery_v", (6800.0, 8200.0), "is it in mV\\?"),
        (Randomization, "sonar_cadence_s", (65.0, 75.0), "is it in ms\\?"),
        (Randomization, "latency_s", (10.0, 40.0), "= 10 s: expected 0 to 0.2 s; is it in ms or us\\?"),
        (EscConfig, "dead_zone", 8, "expected 0 to 0.9; is it in %\\?"),
        (Randomization, "friction", (70.0, 110.0), "is it in %\\?"),
        (Randomization, "hall_miss_rate", (0.0, 5.0), "is it in %\\?"),
    ],
)
def test_a_number_in_another_unit_is_refused(kind: Any, field: str, value: Any, told: str) -> None:
    with pytest.raises(ConfigError, match=f"{kind.__name__}.{field} .*{told}"):
        kind(**{field: value})


@pytest.mark.parametrize("value", ["1", None, True, False, [1.0], 10**400, math.nan, math.inf, 1j])
@pytest.mark.parametrize(
    ("kind", "field", "told"),
    [
        (CarConfig, "wheelbase", "expected a finite number of m"),
        (ServoConfig, "speed", "expected a finite number of rad/s"),
        (EscConfig, "battery_v", "expected a finite number of V"),
        (EscConfig, "dead_zone", "expected a finite number"),
        (UltrasonicConfig, "cadence_s", "expected a finite number of s"),
        (UltrasonicConfig, "rays", "expected a whole number"),
        (HallConfig, "timeout_s", "expected a finite number of s"),
        (config.LineConfig, "pitch", "expected a finite number of m"),
        (config.ImuConfig, "bandwidth_hz", "expected a finite number of Hz"),
        (CameraConfig, "width", "expected a whole number of px"),
        (CameraConfig, "marker_size", "expected a finite number of m"),
        (TaskConfig, "progress_reward", "expected a finite number"),
        (TaskConfig, "touch_speed", "expected a finite number of m/s"),
    ],
)
def test_what_is_no_number_is_refused_with_the_unit(kind: Any, field: str, told: str, value: Any) -> None:
    with pytest.raises(ConfigError, match=f"^{kind.__name__}.{field} = .*: {told}$"):
        kind(**{field: value})


@pytest.mark.parametrize("pair", [("0.7", "1.1"), (None, 1.0), (0.7, True), (0.7, math.nan), (0.7, 10**400)])
def test_a_range_has_two_finite_numbers(pair: Any) -> None:
    with pytest.raises(ConfigError, match=r"^Randomization.friction = .*: expected a finite number$"):
        Randomization(friction=pair)
    with pytest.raises(ConfigError, match=r"^Randomization.battery_v = .*: expected a finite number of V$"):
        Randomization(battery_v=pair)


@pytest.mark.parametrize("pair", [0.9, "ab", (0.9,), (0.7, 0.9, 1.1), None])
def test_a_range_has_two_ends(pair: Any) -> None:
    with pytest.raises(ConfigError, match=r"^Randomization.friction = .*: expected two numbers: low, high$"):
        Randomization(friction=pair)


@pytest.mark.parametrize(
    ("kind", "field"), [(CameraConfig, "width"), (CameraConfig, "height"), (UltrasonicConfig, "rays")]
)
def test_a_count_takes_no_fraction(kind: Any, field: str) -> None:
    for value in (640.5, 12.0):
        with pytest.raises(ConfigError, match=f"{field} = {value}: expected a whole number"):
            kind(**{field: value})
    assert getattr(kind(**{field: np.int64(12)}), field) == 12


@pytest.mark.parametrize(
    ("distortion", "told"),
    [
        ([0.1, 0.0, 0.0, 0.0, 0.0], "expected a tuple of 5 numbers: k1, k2, p1, p2, k3"),
        ((0.1, 0.0, 0.0, 0.0), "expected a tuple of 5 numbers"),
        (None, "expected a tuple of 5 numbers"),
        ((0.1, math.nan, 0.0, 0.0, 0.0), "k2 = nan: expected a finite number"),
        ((0.1, 0.0, 0.0, 0.0, "0"), "k3 = '0': expected a finite number"),
    ],
)
def test_distortion_is_five_finite_numbers(distortion: Any, told: str) -> None:
    with pytest.raises(ConfigError, match=f"CameraConfig.distortion.*{told}"):
        CameraConfig(distortion=distortion)


def test_a_dead_zone_leaves_room_for_throttle() -> None:
    with pytest.raises(ConfigError, match=r"EscConfig.dead_zone = 1: expected 0 to 0\.9"):
        EscConfig(dead_zone=1.0)


def test_the_nominal_car_has_the_configured_values() -> None:
    nominal, esc = LEVELS["none"], EscConfig()
    assert nominal.latency_s == (esc.nominal_latency_s,) * 2
    assert nominal.battery_v == (esc.battery_v,) * 2
    assert nominal.sonar_cadence_s == (UltrasonicConfig().cadence_s,) * 2


def test_a_number_that_no_unit_explains_is_refused_without_a_guess() -> None:
    with pytest.raises(ConfigError, match=r"^here = 1e\+09 m: expected 0 to 2 m$"):
        check_plausible("here", 1e9, 0.0, 2.0, "m")


def test_what_the_project_itself_uses_is_plausible() -> None:
    for kind in (config.LineConfig, config.ImuConfig, CameraConfig, CarConfig, HallConfig, UltrasonicConfig):
        kind()
    assert set(LEVELS) == {"none", "default", "hard"}
