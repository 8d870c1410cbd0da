"""Intervals of figures of trained agents on courses, which hold 95 % with few agents too.

A percentile bootstrap over few agents is too narrow: its variance misses the factor A / (A - 1), and two to five agents
need quantiles of Student's t, not of the normal distribution. So an interval here is the wider one of two:

- percentiles of the stratified bootstrap, which draws whole agents, and courses within their task;
- value +- sqrt(sum t(df)^2 v), where the sum is over the courses and the agents of each contender.

    v_courses = C / (C - 1) var of the bootstrap over courses with all agents      df = T (C - 1)
    v_agents  = (A - 1) / A sum_i (figure without agent i - their mean)^2          df = A - 1

Each part keeps its own quantile: with one common number of degrees of freedom (Satterthwaite) the interval is too
narrow where three agents happen to be alike.

Sources: Efron and Tibshirani 1993, An introduction to the bootstrap, chapters 11 and 13 (jackknife, percentiles);
Zou and Donner 2008, Construction of confidence limits about effect measures (squares of half widths add up).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from tral_fsm.evaluation.statistics import Array, Estimate

Choice = NDArray[np.int64]
"""(b, a) numbers of the agents of a contender that count in each resample."""
Figure = Callable[[bool, Sequence[Choice]], Array]
"""Figure of each resample (b,): whether its courses are resampled or all of them, and a choice for each contender."""

_T_DF = np.array([1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 15, 20, 30, 60, math.inf])
_T_QUANTILE = np.array(
    [12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2281, 2.1788, 2.1314, 2.0860, 2.0423, 2.0003,
     1.9600]
)  # fmt: skip


def t_quantile(df: int) -> float:
    """Quantile of Student's t for a two-sided 95 % interval, df >= 1; beyond 8 it is linear in 1 / df."""
    return float(np.interp(1.0 / df, (1.0 / _T_DF)[::-1], _T_QUANTILE[::-1]))


class Means:
    """Means over the courses of each task, of all courses and of resampled ones."""

    def __init__(self, values: Array, counts: Array) -> None:
        """Sum values up.

        Args:
            values: (a, t, c) of each agent on each course of each task.
            counts: (b, t, c) of `statistics.course_counts`.
        """
        resampled = np.matmul(counts.transpose(1, 0, 2), values.transpose(1, 2, 0)) / values.shape[2]
        self._of = {True: resampled.transpose(1, 2, 0), False: values.mean(axis=2)[None]}

    def of(self, resampled: bool, agents: Choice) -> Array:
        """Means (b, a, t) of the chosen agents."""
        means = self._of[resampled]
        rows = max(len(means), len(agents))
        chosen = np.broadcast_to(agents, (rows, agents.shape[1]))[:, :, None]
        picked: Array = np.take_along_axis(np.broadcast_to(means, (rows, *means.shape[1:])), chosen, axis=1)
        return picked


def interval(
    figure: Figure,
    draws: Sequence[Choice],
    *,
    tasks: int,
    courses: int,
    bounds: tuple[float, float] = (-math.inf, math.inf),
) -> Estimate:
    """A figure with its 95 % interval.

    Args:
        figure: the figure.
        draws: for each contender that it depends on, the agents of the resamples (`statistics.agent_choices`).
        tasks: number of its tasks.
        courses: number of courses of each task.
        bounds: least and greatest value that the figure can have.

    Returns:
        No value where the figure is NaN. No ends where one course of each task, or one agent too few, tells nothing
        of the spread. One agent alone adds no variance: the interval is that of this agent on other courses.
    """
    everyone = [np.arange(draw.shape[1])[None] for draw in draws]
    value = float(figure(False, everyone)[0])
    if not math.isfinite(value):
        return Estimate(value=None, low=None, high=None)
    if courses < 2:
        return Estimate(value=value, low=None, high=None)
    over_courses = _finite(figure(True, everyone))
    parts = [(courses / (courses - 1) * float(np.var(over_courses)), tasks * (courses - 1))]
    for k, draw in enumerate(draws):
        agents = draw.shape[1]
        if agents > 1:
            left = figure(False, [_without_one(agents) if j == k else all_ for j, all_ in enumerate(everyone)])
            parts.append(((agents - 1) / agents * float(np.square(left - left.mean()).sum()), agents - 1))
    half = _half_width(parts)
    if not math.isfinite(half):  # without one of its agents there is no figure
        return Estimate(value=value, low=None, high=None)
    low, high = np.percentile(_finite(figure(True, draws)), (2.5, 97.5))
    return Estimate(
        value=value,
        low=max(min(float(low), value - half), bounds[0]),
        high=min(max(float(high), value + half), bounds[1]),
    )


def _half_width(parts: Sequence[tuple[float, int]]) -> float:
    """Half of the interval from variances and their degrees of freedom."""
    return math.sqrt(sum(t_quantile(df) ** 2 * variance for variance, df in parts))


def _without_one(agents: int) -> Choice:
    """Choices (a, a - 1), each of which leaves out one agent."""
    return np.array([[j for j in range(agents) if j != k] for k in range(agents)])


def _finite(values: Array) -> Array:
    """The resamples in which there is a figure."""
    return values[np.isfinite(values)]
