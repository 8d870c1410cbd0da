"""Intervals and tests of figures over many drives."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RESAMPLES = 2000
"""Number of resamples of the bootstrap. Source: choice; enough for two digits of a 95 % interval."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A figure with its 95 % interval."""

    value: float | None
    low: float | None
    high: float | None


def wilson(successes: float, trials: int, z: float = 1.959964) -> tuple[float, float]:
    """Wilson's score interval of a success rate.

    Args:
        successes: number of successes; the mean over several agents need not be whole.
        trials: number of trials.
        z: quantile of the normal distribution; the default gives 95 %.

    Returns:
        Lower and upper end, in [0, 1]; (0, 1) without a trial.

    Source: Wilson 1927, Probable inference, the law of succession, and statistical inference.
    """
    if trials == 0:
        return 0.0, 1.0
    rate = successes / trials
    scale = 1.0 + z * z / trials
    middle = (rate + z * z / (2 * trials)) / scale
    half = z / scale * math.sqrt(rate * (1.0 - rate) / trials + z * z / (4 * trials * trials))
    # Rounding must not put the rate outside.
    return max(0.0, min(rate, middle - half)), min(1.0, max(rate, middle + half))


def bootstrap(statistic: Callable[[NDArray[np.int64]], Array], n: int, seed: int = 0) -> Estimate:
    """Percentile interval of a figure over n drives.

    Args:
        statistic: function from indices of drives (b, n) to the figure of each resample (b,).
        n: number of drives.
        seed: seed of the resampling.

    Source: Efron 1979, Bootstrap methods: another look at the jackknife.
    """
    if n == 0:
        return Estimate(value=None, low=None, high=None)
    value = float(statistic(np.arange(n)[None])[0])
    if n == 1:
        return Estimate(value=value, low=None, high=None)
    resamples = np.random.default_rng(seed).integers(n, size=(RESAMPLES, n))
    low, high = np.percentile(statistic(resamples), (2.5, 97.5))
    return Estimate(value=value, low=float(low), high=float(high))


def pooled_rmse(rmse: Array, samples: Array) -> Array:
    """RMSE over all samples of drives: sqrt(sum n e^2 / sum n) over the last axis.

    Args:
        rmse: (..., k) RMSE e of each drive.
        samples: (..., k) its number of samples n, above 0.

    Returns:
        (...) in the unit of `rmse`.
    """
    pooled: Array = np.sqrt((samples * rmse**2).sum(axis=-1) / samples.sum(axis=-1))
    return pooled


def sign_test(a: int, b: int) -> float:
    """Two-sided probability that a fair coin splits a + b throws at least as unevenly as a to b."""
    n, few = a + b, min(a, b)
    tail: float = sum(math.comb(n, k) for k in range(few + 1)) / 2**n
    return min(1.0, 2.0 * tail)


# A score matrix has a row for each trained agent and a column for each task: what the agent scored there on average.


def iqm(scores: Array) -> Array:
    """Interquartile mean of score matrices: the mean without the lowest and the highest quarter of the entries.

    Args:
        scores: (..., a, t). Of n entries, floor(n / 4) are left out at either end.

    Returns:
        (...).

    Source: Agarwal et al. 2021, Deep reinforcement learning at the edge of the statistical precipice.
    """
    entries = np.sort(scores.reshape(*scores.shape[:-2], -1), axis=-1)
    n = entries.shape[-1]
    middle: Array = entries[..., n // 4 : n - n // 4].mean(axis=-1)
    return middle


def optimality_gap(scores: Array, target: float = 1.0) -> Array:
    """By how much score matrices (..., a, t) miss a target on average; what is above it does not count: (...).

    Source: as `iqm`.
    """
    gap: Array = np.maximum(target - scores, 0.0).mean(axis=(-2, -1))
    return gap


def performance_profile(scores: Array, levels: Array) -> Array:
    """Share of the scores above each level.

    Args:
        scores: any shape.
        levels: (k,).

    Returns:
        (k,) from 1 down to 0.

    Source: as `iqm`; Dolan and More 2002, Benchmarking optimization software with performance profiles.
    """
    share: Array = (scores.reshape(-1, 1) > levels).mean(axis=0)
    return share


def probability_of_improvement(x: Array, y: Array) -> Array:
    """Probability that an agent of x beats one of y on a task, averaged over the tasks; a tie counts half.

    Args:
        x: (..., a, t) score matrices.
        y: (..., b, t) score matrices on the same tasks.

    Returns:
        (...) in [0, 1]: the statistic U of Mann and Whitney over a b.

    Source: as `iqm`.
    """
    mine, theirs = x[..., :, None, :], y[..., None, :, :]
    won: Array = ((mine > theirs) + 0.5 * (mine == theirs)).mean(axis=(-3, -2, -1))
    return won


def course_counts(tasks: int, courses: int, rng: np.random.Generator, resamples: int = RESAMPLES) -> Array:
    """How often each course of each task is drawn in a resample: (resamples, tasks, courses).

    The courses are drawn within their task, so that each task keeps its weight. Give all contenders the same counts:
    then their differences are paired.
    """
    counts = rng.multinomial(courses, np.full(courses, 1.0 / courses), size=(resamples, tasks))
    return counts.astype(np.float64)


def agent_choices(agents: int, rng: np.random.Generator, resamples: int = RESAMPLES) -> NDArray[np.int64]:
    """Agents drawn with replacement, (resamples, agents): whole agents, since one agent drives all tasks."""
    return rng.integers(agents, size=(resamples, agents))
