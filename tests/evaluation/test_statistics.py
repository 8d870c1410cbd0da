"""Intervals, tests and pooled errors, by hand where that is possible."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_fsm.evaluation.statistics import bootstrap, mean_of, pooled_rmse, sign_test, wilson


def test_wilson_of_known_cases() -> None:
    assert wilson(0, 10) == pytest.approx((0.0, 0.27753), abs=1e-5)
    assert wilson(10, 10) == pytest.approx((0.72247, 1.0), abs=1e-5)
    assert wilson(5, 10) == pytest.approx((0.23659, 0.76341), abs=1e-5)
    assert wilson(0, 0) == (0.0, 1.0)


@given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_holds_the_rate_within_the_unit_interval(counts: tuple[int, int]) -> None:
    successes, trials = counts
    low, high = wilson(successes, trials)
    assert 0 <= low <= successes / trials <= high <= 1


def test_the_sign_test_is_exact() -> None:
    assert sign_test(0, 0) == 1.0
    assert sign_test(0, 5) == pytest.approx(2 / 32)
    assert sign_test(1, 5) == pytest.approx(2 * (1 + 6) / 64)


def test_the_bootstrap_interval_of_a_mean_is_near_the_normal_one() -> None:
    values = np.random.default_rng(1).normal(5.0, 1.0, 100)
    got = mean_of(values.tolist())
    half = 1.96 * values.std() / 10
    assert got.low == pytest.approx(values.mean() - half, abs=0.03)
    assert got.high == pytest.approx(values.mean() + half, abs=0.03)


def test_one_drive_or_none_has_no_interval() -> None:
    assert bootstrap(lambda index: np.zeros(len(index)), 0).value is None
    assert mean_of([3.0]).low is None


def test_an_rmse_of_many_drives_counts_samples() -> None:
    rmse, samples = np.array([3.0, 1.0]), np.array([1.0, 3.0])
    assert pooled_rmse(rmse, samples) == pytest.approx(np.sqrt((9.0 + 3.0) / 4.0))
    rows = np.array([[0, 0], [1, 1]])
    assert pooled_rmse(rmse[rows], samples[rows]) == pytest.approx([3.0, 1.0])
