"""The hall sensor: ticks of a wheel, counted without direction, stamped in time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.config import HallConfig
from tral_env.sensors.hall import Hall

CONFIG = HallConfig()
PERIOD = 0.0125


def drive(hall: Hall, speeds: np.ndarray, seed: int = 1, miss: float = 0.0, double: float = 0.0) -> np.ndarray:
    """Drive with the speeds (t, n) in m/s; the speeds that the sensor tells, (t, n)."""
    rng = np.random.default_rng(seed)
    told = np.zeros(speeds.shape)
    for k, speed in enumerate(speeds):
        hall.update(speed * PERIOD, (k + 1) * PERIOD, PERIOD, rng.random((speeds.shape[1], 2)), miss, double)
        told[k] = hall.speed
    return told


def steady(speed: float, seconds: float) -> np.ndarray:
    return np.full((round(seconds / PERIOD), 1), speed)


def test_forty_ticks_are_one_metre() -> None:
    hall = Hall(1, CONFIG)
    drive(hall, steady(1.0052, 1.0))
    assert hall.ticks[0] == 40
    assert hall.distance[0] == pytest.approx(1.0052)


def test_distance_is_within_half_a_tick_of_the_truth() -> None:
    hall = Hall(1, CONFIG)
    for k in range(400):
        hall.update(np.array([0.0037]), k * PERIOD, PERIOD, np.full((1, 2), 0.5))
        assert abs(hall.distance[0] - 0.0037 * (k + 1)) <= CONFIG.metres_per_tick / 2 + 1e-9


def test_backward_counts_like_forward() -> None:
    forward, backward = Hall(1, CONFIG), Hall(1, CONFIG)
    told_forward, told_backward = drive(forward, steady(0.8, 2.0)), drive(backward, steady(-0.8, 2.0))
    assert backward.ticks[0] == forward.ticks[0]
    assert told_backward[-1] == pytest.approx(told_forward[-1], rel=0.02)


def test_wheel_that_rolls_to_and_fro_over_a_magnet_counts_each_passage() -> None:
    hall = Hall(1, CONFIG)
    for k in range(6):
        hall.update(np.array([0.02 if k % 2 == 0 else -0.02]), k * PERIOD, PERIOD, np.full((1, 2), 0.5))
    assert hall.ticks[0] == 6


def test_several_ticks_in_one_period_are_all_counted() -> None:
    hall = Hall(1, CONFIG)
    hall.update(np.array([5 * CONFIG.metres_per_tick]), PERIOD, PERIOD, np.full((1, 2), 0.5))
    assert hall.ticks[0] == 5


@given(st.lists(st.floats(-0.06, 0.06), min_size=1, max_size=30))
def test_ticks_never_go_down_and_never_exceed_the_way(steps: list[float]) -> None:
    hall = Hall(1, CONFIG)
    before = 0
    for k, step in enumerate(steps):
        hall.update(np.array([step]), k * PERIOD, PERIOD, np.full((1, 2), 0.5))
        assert before <= hall.ticks[0] <= before + abs(step) / CONFIG.metres_per_tick + 1
        before = int(hall.ticks[0])


@pytest.mark.parametrize("speed", [0.3, 1.0, 2.0])
def test_steady_speed_is_told_within_one_and_a_half_percent(speed: float) -> None:
    told = drive(Hall(1, CONFIG), steady(speed, 4.0))[80:]
    assert told == pytest.approx(np.full(told.shape, speed), rel=0.015)


@pytest.mark.parametrize(("speed", "noise"), [(0.3, 0.02), (1.0, 0.06), (2.0, 0.15)])
def test_one_percent_of_bad_ticks_leaves_the_speed_usable(speed: float, noise: float) -> None:
    told = drive(Hall(1, CONFIG), steady(speed, 60.0), miss=0.01, double=0.01)[80:]
    assert told.std() < noise
    assert told.mean() == pytest.approx(speed, rel=0.02)


def test_one_doubled_tick_does_not_show_in_the_speed() -> None:
    hall = Hall(1, CONFIG)
    drive(hall, steady(1.0, 1.0))
    for k in range(80, 100):
        doubled = 1.0 if k == 82 else 0.0
        hall.update(np.array([PERIOD]), (k + 1) * PERIOD, PERIOD, np.full((1, 2), 0.5), 0.0, doubled)
        assert hall.speed[0] == pytest.approx(1.0, rel=0.06)


def test_speed_follows_a_start_from_rest_after_two_ticks() -> None:
    hall = Hall(1, CONFIG)
    told = drive(hall, steady(0.5, 0.5))[:, 0]
    second_tick = 1.5 * CONFIG.metres_per_tick / 0.5
    assert told[int(second_tick / PERIOD) - 1] == 0.0
    assert told[int(second_tick / PERIOD) + 1] == pytest.approx(0.5, rel=0.02)


def test_speed_falls_while_the_next_tick_is_overdue_and_is_zero_after_the_timeout() -> None:
    hall = Hall(1, CONFIG)
    speeds = np.concatenate([steady(1.0, 1.0), steady(0.0, 0.4)])
    told = drive(hall, speeds)[80:, 0]
    assert np.all(np.diff(told) <= 0)
    assert told[7] <= CONFIG.metres_per_tick / 0.09
    assert told[-1] == 0.0


def test_missed_ticks_shorten_the_distance_by_their_rate() -> None:
    hall = Hall(64, CONFIG)
    drive(hall, np.full((1600, 64), 1.0), miss=0.05)
    assert hall.ticks.mean() / (20.0 / CONFIG.metres_per_tick) == pytest.approx(0.95, abs=0.005)


def test_doubled_ticks_lengthen_the_distance_by_their_rate() -> None:
    hall = Hall(64, CONFIG)
    drive(hall, np.full((1600, 64), 1.0), double=0.05)
    assert hall.ticks.mean() / (20.0 / CONFIG.metres_per_tick) == pytest.approx(1.05, abs=0.005)


def test_rates_hold_when_several_ticks_fall_into_a_period() -> None:
    hall = Hall(64, CONFIG)
    drive(hall, np.full((800, 64), 4.5), miss=0.05)
    assert hall.ticks.mean() / (45.0 / CONFIG.metres_per_tick) == pytest.approx(0.95, abs=0.005)


def test_rows_do_not_touch_each_other() -> None:
    rng = np.random.default_rng(7)
    speeds, uniform = rng.uniform(-2.0, 4.0, (300, 8)), rng.random((300, 8, 2))
    together, alone = Hall(8, CONFIG), [Hall(1, CONFIG) for _ in range(8)]
    for k in range(300):
        time_s = (k + 1) * PERIOD
        together.update(speeds[k] * PERIOD, time_s, PERIOD, uniform[k], 0.05, 0.05)
        for i, hall in enumerate(alone):
            hall.update(speeds[k, i : i + 1] * PERIOD, time_s, PERIOD, uniform[k, i : i + 1], 0.05, 0.05)
        assert together.speed.tobytes() == np.concatenate([hall.speed for hall in alone]).tobytes()
    assert together.ticks.tolist() == [int(hall.ticks[0]) for hall in alone]


def test_reset_puts_only_the_named_rows_at_rest() -> None:
    hall = Hall(3, CONFIG)
    drive(hall, np.full((80, 3), 1.0))
    hall.reset(np.array([1]))
    assert hall.ticks.tolist() == [40, 0, 40]
    assert hall.speed == pytest.approx([1.0, 0.0, 1.0], rel=0.02)
