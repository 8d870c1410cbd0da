"""Noise of a row: its own, drawn once, never read twice."""

import numpy as np
import pytest

from tral_env.noise import LENGTH, NoiseTape
from tral_env.options import CorridorConfig
from tral_env.world import World

ROW = np.zeros(1, np.int64)
ROWS = np.arange(3)


def tapes(*seeds: int, length: int = LENGTH) -> NoiseTape:
    tape = NoiseTape(len(seeds), length)
    for row, seed in enumerate(seeds):
        tape.reset(row, np.random.default_rng(seed))
    return tape


def test_the_noise_of_a_row_does_not_depend_on_other_rows() -> None:
    alone, among = tapes(5), tapes(1, 5, 9)
    among.uniform(np.array([0, 2]), 7)
    assert np.array_equal(alone.uniform(ROW, 4), among.uniform(np.array([1]), 4))
    assert np.array_equal(alone.normal(ROW, 4), among.normal(np.array([1, 2]), 4)[:1])


def test_nor_does_it_where_the_tape_is_drawn_anew() -> None:
    alone, among = tapes(5, length=10), tapes(1, 5, 9, length=10)
    among.uniform(np.array([0, 2]), 7)
    for _ in range(9):
        assert np.array_equal(alone.uniform(ROW, 4), among.uniform(ROWS, 4)[1:2])


def test_no_number_is_read_twice() -> None:
    tape = tapes(0, length=10)
    read = np.concatenate([tape.uniform(ROW, 4)[0] for _ in range(100)])
    assert len(np.unique(read)) == 400


def test_what_is_rare_comes_at_its_rate_in_every_row() -> None:
    """Six numbers for each of three sonars, 20 000 times: 300 outliers a row are expected, give or take 17."""
    tape = tapes(0, 1, 2)
    rare = sum((tape.uniform(ROWS, 18).reshape(3, 3, 6)[:, :, 3] < 0.005).sum(axis=1) for _ in range(20_000))
    assert np.all(np.abs(rare - 300) < 4 * 17)


def test_a_car_that_stands_for_long_reads_outliers_at_the_rate_that_was_drawn() -> None:
    world = World(3, CorridorConfig(scenario="straight", randomization="none"))
    rngs = [np.random.default_rng(seed) for seed in range(3)]
    world.reset(world.request(ROWS, {"car": {"sonar_outlier_rate": 0.1}}), rngs)
    still, left, age = np.zeros((3, 2)), [], []
    for _ in range(2000):
        reading = world.layout.unpack(world.step(still).observation)
        left.append(reading["ultrasonic_left"].copy())
        age.append(reading["ultrasonic_left_age"].copy())
    new = np.diff(np.array(age), axis=0) < 0
    strange = np.abs(np.array(left) - np.median(left, axis=0))[1:] > 0.05
    share = (strange & new).sum(axis=0) / new.sum(axis=0)
    assert np.all(new.sum(axis=0) > 350)
    assert share == pytest.approx(np.full(3, 0.1), abs=0.05)
