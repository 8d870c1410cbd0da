"""The inertial sensor: bias, noise, range and resolution after the data sheet."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tral_env.config import ImuConfig
from tral_env.interface import OPTIONAL_GROUPS
from tral_env.sensors.imu import AXES, STANDARD_GRAVITY, draw_bias, full_scale, measure, noise_sigma

CONFIG = ImuConfig()
AT_REST = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, STANDARD_GRAVITY]])
CALM = np.zeros((1, AXES))


def test_reading_without_noise_and_bias_is_the_truth_within_a_unit() -> None:
    reading = measure(AT_REST, 0.0, CALM, CONFIG)
    assert reading == pytest.approx(AT_REST, abs=4 * STANDARD_GRAVITY / 32768)


def test_reading_comes_in_units_of_a_16_bit_register() -> None:
    unit = math.radians(500.0) / 32768
    truth = np.array([[10.4 * unit, 0.0, 0.0, 0.0, 0.0, 0.0]])
    assert measure(truth, 0.0, CALM, CONFIG)[0, 0] == pytest.approx(10 * unit)


def test_noise_is_the_density_times_the_root_of_the_bandwidth() -> None:
    sigma = noise_sigma(CONFIG)
    assert np.degrees(sigma[0]) == pytest.approx(0.01 * math.sqrt(41.0))
    assert sigma[3] == pytest.approx(300e-6 * 9.80665 * math.sqrt(41.0))


def test_readings_scatter_by_that_noise() -> None:
    normal = np.random.default_rng(1).standard_normal((100_000, AXES))
    reading = measure(np.tile(AT_REST, (100_000, 1)), 0.0, normal, CONFIG)
    assert reading.std(axis=0) == pytest.approx(noise_sigma(CONFIG), rel=0.02)
    assert reading.mean(axis=0) == pytest.approx(AT_REST[0], abs=1e-3)


def test_bias_shifts_every_reading() -> None:
    bias = draw_bias(np.ones((1, AXES)), CONFIG)
    assert np.degrees(bias[0, 0]) == pytest.approx(0.1)
    assert bias[0, 5] == pytest.approx(0.03 * 9.80665)
    shift = measure(AT_REST, bias, CALM, CONFIG) - measure(AT_REST, 0.0, CALM, CONFIG)
    assert shift == pytest.approx(bias, abs=2e-3)


def test_reading_stays_within_full_scale() -> None:
    reading = measure(np.full((1, AXES), 1e3), 0.0, CALM, CONFIG)
    assert np.all(reading < full_scale(CONFIG))
    assert measure(np.full((1, AXES), -1e3), 0.0, CALM, CONFIG) == pytest.approx(-full_scale(CONFIG)[None])


def test_full_scale_fits_the_bounds_of_the_observation() -> None:
    bounds = np.array([field.high for field in OPTIONAL_GROUPS["imu"]])
    assert np.all(full_scale(CONFIG) <= bounds)


def test_rows_do_not_touch_each_other() -> None:
    rng = np.random.default_rng(4)
    truth, normal = rng.normal(0, 5, (8, AXES)), rng.standard_normal((8, AXES))
    together = measure(truth, 0.0, normal, CONFIG)
    alone = [measure(truth[i : i + 1], 0.0, normal[i : i + 1], CONFIG)[0] for i in range(8)]
    assert together.tobytes() == np.array(alone).tobytes()
