"""Intervals, tests and pooled errors, by hand where that is possible."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from tral_fsm.evaluation.statistics import (
    agent_choices,
    bootstrap,
    course_counts,
    iqm,
    optimality_gap,
    performance_profile,
    pooled_rmse,
    probability_of_improvement,
    sign_test,
    wilson,
)

Array = NDArray[np.float64]


def matrices(agents: int, tasks: int) -> st.SearchStrategy[Array]:
    """Score matrices whose scores are quarters, so that ties are common and sums exact."""
    return arrays(np.float64, (agents, tasks), elements=st.integers(0, 4).map(lambda k: k / 4))


ANY_MATRIX = st.tuples(st.integers(1, 6), st.integers(1, 5)).flatmap(lambda shape: matrices(*shape))


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
    got = bootstrap(lambda index: values[index].mean(axis=1), 100)
    half = 1.96 * values.std() / 10
    assert got.low == pytest.approx(values.mean() - half, abs=0.03)
    assert got.high == pytest.approx(values.mean() + half, abs=0.03)


def test_one_drive_or_none_has_no_interval() -> None:
    assert bootstrap(lambda index: np.zeros(len(index)), 0).value is None
    assert bootstrap(lambda index: np.full(len(index), 3.0), 1).low is None


def test_an_rmse_of_many_drives_counts_samples() -> None:
    rmse, samples = np.array([3.0, 1.0]), np.array([1.0, 3.0])
    assert pooled_rmse(rmse, samples) == pytest.approx(np.sqrt((9.0 + 3.0) / 4.0))
    rows = np.array([[0, 0], [1, 1]])
    assert pooled_rmse(rmse[rows], samples[rows]) == pytest.approx([3.0, 1.0])


def test_the_iqm_of_known_cases() -> None:
    """As rliable's `aggregate_iqm`: scipy.stats.trim_mean(scores, 0.25, axis=None)."""
    assert iqm(np.arange(8.0).reshape(2, 4)) == 3.5  # of 0 to 7 stay 2 to 5
    assert iqm(np.array([[0.0, 0.0, 1.0, 9.0]])) == 0.5
    assert iqm(np.array([[0.0, 3.0, 100.0]])) == pytest.approx(103.0 / 3.0)  # a quarter of three is no entry
    assert iqm(np.array([[0.0, 1.0, 2.0, 3.0, 100.0]])) == 2.0


@given(ANY_MATRIX)
def test_the_iqm_is_that_of_scipy(scores: Array) -> None:
    stats = pytest.importorskip("scipy.stats")
    assert iqm(scores) == pytest.approx(stats.trim_mean(scores, 0.25, axis=None))


@given(ANY_MATRIX)
def test_the_iqm_lies_between_the_least_and_the_greatest_score(scores: Array) -> None:
    assert scores.min() <= iqm(scores) <= scores.max()


@given(ANY_MATRIX, st.integers(-3, 3), st.integers(1, 4))
def test_the_iqm_follows_scale_and_shift_and_no_order(scores: Array, shift: int, scale: int) -> None:
    assert iqm(scale * scores + shift) == pytest.approx(scale * iqm(scores) + shift)
    assert iqm(scores[::-1, ::-1]) == iqm(scores)


@given(ANY_MATRIX)
def test_matrices_in_a_stack_are_summed_up_one_by_one(scores: Array) -> None:
    stack = np.array([scores, 1.0 - scores])
    assert iqm(stack).tolist() == [iqm(scores), iqm(1.0 - scores)]
    assert optimality_gap(stack) == pytest.approx([optimality_gap(scores), optimality_gap(1.0 - scores)])
    assert probability_of_improvement(stack, stack[::-1]) == pytest.approx(
        [probability_of_improvement(scores, 1.0 - scores), probability_of_improvement(1.0 - scores, scores)]
    )


def test_the_optimality_gap_does_not_reward_what_is_above_the_target() -> None:
    assert optimality_gap(np.array([[0.5, 1.5]])) == 0.25
    assert optimality_gap(np.array([[0.5, 1.5]]), target=2.0) == 1.0


def test_a_performance_profile_counts_what_is_above() -> None:
    scores = np.array([[0.0, 0.5], [0.5, 1.0]])
    assert performance_profile(scores, np.array([-1.0, 0.0, 0.5, 1.0])).tolist() == [1.0, 0.75, 0.25, 0.0]


@given(ANY_MATRIX)
def test_a_performance_profile_never_rises_and_its_area_is_the_mean(scores: Array) -> None:
    levels = np.arange(0.0, 1.0, 0.25)
    profile = performance_profile(scores, levels)
    assert (np.diff(profile) <= 0).all()
    assert 0.25 * profile.sum() == pytest.approx(scores.mean())


def test_the_probability_of_improvement_of_known_cases() -> None:
    """As rliable's: U of Mann and Whitney over the pairs, averaged over tasks."""
    better, worse = np.array([[3.0], [4.0]]), np.array([[1.0], [2.0]])
    assert probability_of_improvement(better, worse) == 1.0
    assert probability_of_improvement(worse, better) == 0.0
    assert probability_of_improvement(np.array([[1.0], [3.0]]), np.array([[2.0]])) == 0.5
    assert probability_of_improvement(np.array([[1.0, 1.0]]), np.array([[1.0, 0.0]])) == 0.75  # a tie and a win


@given(matrices(3, 2), matrices(4, 2))
def test_the_probability_of_improvement_is_that_of_scipy(x: Array, y: Array) -> None:
    stats = pytest.importorskip("scipy.stats")
    u = [stats.mannwhitneyu(x[:, k], y[:, k], alternative="greater", method="asymptotic").statistic for k in range(2)]
    assert probability_of_improvement(x, y) == pytest.approx(np.mean(u) / 12)
    assert probability_of_improvement(x, y) + probability_of_improvement(y, x) == pytest.approx(1.0)


# Two score matrices, and what rliable 1.2.0 (https://github.com/google-research/rliable) says of them.
X = np.array([[12, 55, 90], [31, 47, 88], [20, 62, 71], [8, 39, 95], [27, 58, 64]]) / 100
Y = np.array([[15, 50, 92], [25, 47, 60], [20, 44, 70], [11, 41, 85]]) / 100


def test_aggregates_are_those_of_rliable() -> None:
    """`aggregate_iqm`, `aggregate_optimality_gap`, `probability_of_improvement`, `run_score_deviation`."""
    assert (iqm(X), iqm(Y)) == pytest.approx((0.5044444444, 0.4450000000))
    assert (optimality_gap(X), optimality_gap(Y)) == pytest.approx((0.4886666667, 0.5333333333))
    assert (optimality_gap(X, 0.5), optimality_gap(Y, 0.5)) == pytest.approx((0.1106666667, 0.1225000000))
    assert (probability_of_improvement(X, Y), probability_of_improvement(Y, X)) == pytest.approx((0.65, 0.35))
    assert performance_profile(X, np.array([0.0, 0.2, 0.47, 0.9])) == pytest.approx([1.0, 0.8, 0.5333333333, 0.0666667])


def test_aggregates_are_those_of_the_tests_of_rliable() -> None:
    """The matrices and values of its tests/rliable/metrics_test.py."""
    x, y = np.array([[1.0, 2.0], [2.0, 2.0], [1.0, 1.0], [2.0, 1.0]]), np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]])
    assert (iqm(x), iqm(y)) == (1.5, 2.0)
    assert probability_of_improvement(x, y) == pytest.approx(1 / 3)


def test_agents_on_one_task_are_resampled_as_in_rliable() -> None:
    """`get_interval_estimates` of the IQM and of the mean, 20,000 resamples; on one task an agent is a run."""
    runs = np.sort(X[:4].ravel())[:, None]
    drawn = runs[agent_choices(len(runs), np.random.default_rng(0), resamples=20_000)]
    assert np.percentile(iqm(drawn), (2.5, 97.5)) == pytest.approx([0.2883, 0.7500], abs=0.015)
    assert np.percentile(drawn.mean(axis=(1, 2)), (2.5, 97.5)) == pytest.approx([0.3525, 0.6808], abs=0.01)


def test_courses_are_resampled_within_their_task_as_runs_are_in_rliable() -> None:
    """`get_interval_estimates` of the mean, 50,000 resamples, stratified over the tasks."""
    counts = course_counts(X.shape[1], X.shape[0], np.random.default_rng(0), resamples=20_000)
    means = (counts * X.T).sum(axis=(1, 2)) / X.size
    assert np.percentile(means, (2.5, 97.5)) == pytest.approx([0.4613, 0.5587], abs=0.004)


def test_a_resample_draws_as_many_courses_of_each_task_as_there_are() -> None:
    counts = course_counts(3, 7, np.random.default_rng(0), resamples=50)
    assert counts.shape == (50, 3, 7)
    assert (counts.sum(axis=2) == 7).all()
    assert (counts >= 0).all()


def test_the_same_generator_draws_the_same_resamples() -> None:
    first, second = (course_counts(2, 5, np.random.default_rng(3), resamples=9) for _ in range(2))
    assert (first == second).all()
