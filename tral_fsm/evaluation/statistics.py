"""Intervals and tests of figures over many drives."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
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


def wilson(successes: int, trials: int, z: float = 1.959964) -> tuple[float, float]:
    """Wilson's score interval of a success rate.

    Args:
        successes: number of successes.
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


def mean_of(values: Sequence[float]) -> Estimate:
    """Mean with its bootstrap interval."""
    array = np.array(values, float)
    return bootstrap(lambda index: array[index].mean(axis=1), len(array))


def sign_test(a: int, b: int) -> float:
    """Two-sided probability that a fair coin splits a + b throws at least as unevenly as a to b."""
    n, few = a + b, min(a, b)
    tail: float = sum(math.comb(n, k) for k in range(few + 1)) / 2**n
    return min(1.0, 2.0 * tail)
