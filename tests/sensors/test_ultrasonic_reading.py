"""From the first echo to what the ranger reads: jitter, outliers, limits, resolution, crosstalk."""

from __future__ import annotations

import numpy as np
import pytest

from tral_env.config import UltrasonicConfig
from tral_env.errors import ConfigError
from tral_env.interface import NO_ECHO_M
from tral_env.sensors import ultrasonic
from tral_env.sensors.ultrasonic import Array, crosstalk, measure

CALM = UltrasonicConfig(jitter_share=0.0)
JITTERY = UltrasonicConfig()
CENTIMETRES = UltrasonicConfig(jitter_share=0.0, mode="cm")
N = 200_000


def read(range_m: float, config: UltrasonicConfig = CALM) -> float:
    return float(measure(np.array([range_m]), np.full((1, ultrasonic.MEASURE_DRAWS), 0.5), config)[0])


def draws(seed: int = 3) -> Array:
    return np.random.default_rng(seed).random((N, ultrasonic.MEASURE_DRAWS))


def test_one_metre_reads_one_metre() -> None:
    assert read(1.0) == pytest.approx(1.0, abs=1e-4)


def test_reading_is_a_whole_number_of_microseconds() -> None:
    # 1 m is 5827.5 us of flight there and back.
    assert read(1.0001) == pytest.approx(5828 * 1.716e-4, abs=1e-12)


def test_no_echo_reads_the_no_echo_range() -> None:
    assert read(np.inf) == NO_ECHO_M


@pytest.mark.parametrize("range_m", [0.02, 5.1])
def test_microsecond_mode_ranges_from_3_cm_to_5_m(range_m: float) -> None:
    assert read(range_m) == NO_ECHO_M
    assert read(0.031) == pytest.approx(0.031, abs=1e-4)
    assert read(4.99) == pytest.approx(4.99, abs=1e-4)


@pytest.mark.parametrize("range_m", [0.15, 3.2])
def test_centimetre_mode_ranges_from_20_cm_to_3_m(range_m: float) -> None:
    assert read(range_m, CENTIMETRES) == NO_ECHO_M
    assert read(0.21, CENTIMETRES) == pytest.approx(0.21, abs=1e-12)
    assert read(2.99, CENTIMETRES) == pytest.approx(2.99, abs=1e-12)


@pytest.mark.parametrize(("range_m", "expected"), [(1.004, 1.00), (1.006, 1.01), (0.7549, 0.75)])
def test_centimetre_mode_reads_whole_centimetres(range_m: float, expected: float) -> None:
    assert read(range_m, CENTIMETRES) == pytest.approx(expected, abs=1e-12)


def test_unknown_mode_is_an_error() -> None:
    with pytest.raises(ConfigError, match="Allowed: us, cm"):
        UltrasonicConfig(mode="inch")


def test_jitter_comes_in_steps_of_8_65_mm() -> None:
    reading = measure(np.full(N, 1.0), draws(), JITTERY)
    steps = (reading - 1.0) / 0.00865
    assert np.abs(steps - np.rint(steps)).max() < 0.02  # within the resolution of 0.17 mm
    assert set(np.rint(steps).tolist()) == {-1.0, 0.0, 1.0}


def test_jitter_has_the_stated_share_and_no_bias() -> None:
    reading = measure(np.full(N, 1.0), draws(), JITTERY)
    steps = np.rint((reading - 1.0) / 0.00865)
    assert (steps == -1).mean() == pytest.approx(0.15, abs=0.005)
    assert (steps == 1).mean() == pytest.approx(0.15, abs=0.005)
    assert reading.std() == pytest.approx(0.00474, abs=0.0001)


def test_outliers_come_at_the_stated_rate() -> None:
    reading = measure(np.full(N, 1.0), draws(), CALM, 0.05)
    assert (np.abs(reading - 1.0) > 0.001).mean() == pytest.approx(0.05, abs=0.003)


def test_half_of_the_outliers_are_lost_three_in_ten_short_two_in_ten_second_echoes() -> None:
    reading = measure(np.full(N, 1.0), draws(), CALM, 1.0)
    assert (reading == NO_ECHO_M).mean() == pytest.approx(0.5, abs=0.01)
    assert (reading < 1.0 - 1e-3).mean() == pytest.approx(0.3, abs=0.01)
    assert (np.abs(reading - 2.0) < 1e-3).mean() == pytest.approx(0.2, abs=0.01)


def test_second_echo_beyond_the_maximum_range_is_lost() -> None:
    reading = measure(np.full(N, 2.6), draws(), CALM, 1.0)
    assert reading[(reading > 2.6) & (reading != NO_ECHO_M)].size == 0


def test_false_echo_can_come_where_there_is_nothing() -> None:
    reading = measure(np.full(N, np.inf), draws(), CALM, 1.0)
    assert (reading < NO_ECHO_M).mean() == pytest.approx(0.3, abs=0.01)


def test_outlier_rate_is_the_rows_own() -> None:
    uniform = np.tile([0.5, 0.01, 0.1, 0.5], (2, 1))
    assert measure(np.ones(2), uniform, CALM, np.array([0.0, 0.02])) == pytest.approx([1.0, NO_ECHO_M], abs=1e-4)


def test_rows_do_not_touch_each_other() -> None:
    uniform, first = draws()[:8], np.linspace(0.1, 4.0, 8)
    rate = np.linspace(0.0, 1.0, 8)
    together = measure(first, uniform, JITTERY, rate)
    alone = [measure(first[i : i + 1], uniform[i : i + 1], JITTERY, rate[i : i + 1])[0] for i in range(8)]
    assert together.tobytes() == np.array(alone).tobytes()


def test_crosstalk_reads_half_the_sum_of_two_paths() -> None:
    first = np.array([[1.0], [3.0], [2.0]])
    heard = crosstalk(first, np.zeros((3, 1)), np.array([True]), CALM)
    assert heard[:, 0] == pytest.approx([1.0, 2.0, 2.0])


def test_crosstalk_needs_sonars_that_fire_together() -> None:
    first = np.array([[1.0, 1.0], [3.0, 3.0], [2.0, 2.0]])
    heard = crosstalk(first, np.zeros((3, 2)), np.array([True, False]), CALM)
    assert heard[1] == pytest.approx([2.0, 3.0])


def test_crosstalk_comes_at_the_stated_share() -> None:
    first = np.tile([[1.0], [3.0], [2.0]], (1, N))
    heard = crosstalk(first, np.random.default_rng(5).random((3, N)), np.ones(N, bool), CALM)
    assert (heard[1] == 2.0).mean() == pytest.approx(0.1, abs=0.005)


def test_crosstalk_of_nothing_is_nothing() -> None:
    first = np.full((3, 1), np.inf)
    assert np.isinf(crosstalk(first, np.zeros((3, 1)), np.array([True]), CALM)).all()
