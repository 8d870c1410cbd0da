"""Intervals over agents and courses hold what they promise, with few agents too."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tral_fsm.evaluation.intervals import Means, interval, t_quantile
from tral_fsm.evaluation.statistics import Array, Estimate, agent_choices, course_counts, iqm


def mean_interval(values: Array, rng: np.random.Generator, resamples: int = 200) -> Estimate:
    """Interval of the mean of values (a, t, c)."""
    agents, tasks, courses = values.shape
    means = Means(values, course_counts(tasks, courses, rng, resamples))
    return interval(
        lambda resampled, chosen: means.of(resampled, chosen[0]).mean(axis=(1, 2)),
        [agent_choices(agents, rng, resamples)],
        tasks=tasks,
        courses=courses,
    )


def test_quantiles_of_student_are_those_of_the_books() -> None:
    assert [t_quantile(df) for df in (1, 2, 4, 10, 10**9)] == pytest.approx(
        [12.7062, 4.3027, 2.7764, 2.2281, 1.96], abs=1e-4
    )


@given(st.integers(1, 10**6))
def test_quantiles_of_student_are_those_of_scipy(df: int) -> None:
    stats = pytest.importorskip("scipy.stats")
    assert t_quantile(df) == pytest.approx(stats.t.ppf(0.975, df), rel=0.002)


def test_means_are_those_of_the_drawn_agents_and_courses() -> None:
    values = np.array([[[0.0, 1.0], [2.0, 4.0]], [[10.0, 20.0], [30.0, 50.0]]])  # agents x tasks x courses
    means = Means(values, np.array([[[2.0, 0.0], [1.0, 1.0]], [[0.0, 2.0], [0.0, 2.0]]]))
    got = means.of(True, np.array([[1, 1], [1, 0]]))
    assert got.tolist() == [[[10.0, 40.0], [10.0, 40.0]], [[20.0, 50.0], [1.0, 4.0]]]
    assert means.of(False, np.array([[1], [0]])).tolist() == [[[15.0, 40.0]], [[0.5, 3.0]]]


@pytest.mark.parametrize("agents", [2, 3, 5, 12])
def test_the_interval_over_agents_and_courses_covers_the_true_mean(agents: int) -> None:
    """Percentiles of the bootstrap alone cover it in 66 % with 2 agents, 81 % with 3, and 91 % with 5."""
    rng, held, runs = np.random.default_rng(7), 0, 200
    for _ in range(runs):
        agent, course = rng.normal(0.0, 0.1, (agents, 1, 1)), rng.normal(0.0, 0.2, (1, 2, 40))
        got = mean_interval(0.5 + agent + course + rng.normal(0.0, 0.2, (agents, 2, 40)), rng)
        assert got.low is not None
        assert got.high is not None
        held += got.low <= 0.5 <= got.high
    assert 0.92 <= held / runs <= 0.995


@pytest.mark.parametrize("courses", [2, 4, 20])
def test_the_interval_of_one_agent_covers_its_own_mean_over_all_courses(courses: int) -> None:
    rng, held, runs = np.random.default_rng(3), 0, 200
    for _ in range(runs):
        got = mean_interval(rng.normal(0.5, 0.2, (1, 2, courses)), rng)
        assert got.low is not None
        assert got.high is not None
        held += got.low <= 0.5 <= got.high
    assert held / runs >= 0.9


def test_one_course_of_each_task_has_no_interval() -> None:
    values: NDArray[np.float64] = np.array([[[0.0], [1.0]]])
    assert mean_interval(values, np.random.default_rng(0)) == Estimate(value=0.5, low=None, high=None)


def test_an_interval_stays_within_its_bounds_and_holds_its_value() -> None:
    rng = np.random.default_rng(1)
    means = Means(np.array([[[1.0, 0.9]], [[0.6, 0.5]]]), course_counts(1, 2, rng, 50))
    got = interval(
        lambda resampled, chosen: iqm(means.of(resampled, chosen[0])),
        [agent_choices(2, rng, 50)],
        tasks=1,
        courses=2,
        bounds=(0.0, 1.0),
    )
    assert (got.low, got.value, got.high) == (0.0, pytest.approx(0.75), 1.0)


def test_a_figure_that_is_none_has_no_interval() -> None:
    draws = [np.zeros((5, 2), np.int64)]
    none = interval(lambda _, chosen: np.full(len(chosen[0]), np.nan), draws, tasks=1, courses=3)
    assert none == Estimate(value=None, low=None, high=None)
    needs_both = interval(
        lambda _, chosen: np.where(np.ptp(chosen[0], axis=1) > 0, 1.0, np.nan), draws, tasks=1, courses=3
    )
    assert needs_both == Estimate(value=1.0, low=None, high=None)


def test_shared_courses_make_a_difference_certain_that_is_the_same_on_each() -> None:
    rng = np.random.default_rng(0)
    hard = rng.uniform(size=(1, 2, 30))  # how hard each course is hides the difference of 0.1 if it is not paired
    counts = course_counts(2, 30, rng, resamples=200)
    better, worse, one = Means(hard + 0.1, counts), Means(hard, counts), np.zeros((200, 1), np.int64)
    got = interval(
        lambda resampled, chosen: (better.of(resampled, chosen[0]) - worse.of(resampled, chosen[1])).mean(axis=(1, 2)),
        [one, one],
        tasks=2,
        courses=30,
    )
    assert (got.low, got.high) == pytest.approx((0.1, 0.1))
