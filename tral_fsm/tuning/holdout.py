"""The old against the new machine on held-out courses, course by course, with intervals and a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_fsm.evaluation.episode import EpisodeResult
from tral_fsm.evaluation.statistics import Estimate, bootstrap, pooled_rmse, sign_test, wilson
from tral_fsm.tuning.objective import PARTS, Objective, parts

Array = NDArray[np.float64]
Drives = Sequence[EpisodeResult]
Statistic = Callable[[NDArray[np.int64]], Array]
"""A figure over drives: indices of drives (b, n) -> the figure of each of b resamples (b,)."""

MIN_COURSES = 6
"""Number of courses for a verdict: the sign test gives 2 / 2^5 > 5 % on five, and 2 / 2^6 < 5 % on six."""


class Change(StrEnum):
    """What the search has changed."""

    BETTER = "better"
    WORSE = "worse"
    NOISE = "noise"


_VERDICTS = {
    Change.BETTER: "The cost of the tuned machine is lower on drives that it was not tuned on",
    Change.WORSE: "The cost of the tuned machine is higher on drives that it was not tuned on",
    Change.NOISE: "The change of the cost is within noise: on other drives the old machine may well be better",
}
_SAID = {Change.BETTER: "Better", Change.WORSE: "Worse", Change.NOISE: "No clear change"}


@dataclass(frozen=True, kw_only=True)
class Paired:
    """A figure of the old and of the new machine over the same courses, cars and noise."""

    old: Estimate
    new: Estimate
    difference: Estimate
    """`new` minus `old`; bootstrap over the courses, each of which counts for both machines."""
    courses: int
    """Number of courses that it is measured on, such as those where both arrived."""
    more_is_better: bool = False

    @property
    def too_few(self) -> bool:
        """Whether it is measured on too few courses to tell anything."""
        return self.courses < MIN_COURSES

    @property
    def change(self) -> Change:
        """Whether the new machine is better or worse by it, or neither, as the interval of the difference holds 0.

        On fewer courses than `MIN_COURSES` luck alone improves all of them more than one time in 20.
        """
        low, high = self.difference.low, self.difference.high
        if self.too_few or low is None or high is None or low <= 0.0 <= high:
            return Change.NOISE
        return Change.BETTER if (low > 0.0) == self.more_is_better else Change.WORSE


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """The old and the new machine on the same courses, cars and noise."""

    courses: int
    collisions: tuple[int, int]
    """Number of drives of the old and of the new machine that ended at a wall."""
    only_old: int
    """Number of courses on which only the old machine arrived."""
    only_new: int
    """Number of courses on which only the new machine arrived."""
    sign_p: float
    """Probability that luck alone splits these courses as unevenly (exact sign test, McNemar 1947)."""
    success: Paired
    """Success rate; the rates have Wilson's interval."""
    clearance_rmse_m: Paired
    """RMSE over all ticks of the courses where both arrived, m."""
    settled_rmse_m: Paired
    """RMSE over the settled ticks of the courses where both arrived, see `tral_fsm.evaluation.settling`, m."""
    time_per_m: Paired
    """Mean over the courses where both arrived, s/m."""
    steering_per_m: Paired
    """Mean steering travel over the courses where both arrived, 1/m."""
    cost: Paired
    """Mean over all courses."""
    cost_parts: dict[str, Paired]
    """Part of the cost -> its weighted mean over all courses; they add up to `cost`."""

    @property
    def figures(self) -> dict[str, Paired]:
        """What a user looks at, by name: all that the cost is made of, and the settled RMSE."""
        return {
            "success": self.success,
            "clearance RMSE": self.clearance_rmse_m,
            "settled RMSE": self.settled_rmse_m,
            "time": self.time_per_m,
            "steering": self.steering_per_m,
        }

    @property
    def change(self) -> Change:
        """Whether the cost of the new machine is better, worse, or neither beyond noise."""
        return self.cost.change

    @property
    def within_noise(self) -> bool:
        """Whether luck may explain the change of the cost, or there are too few courses."""
        return self.change is Change.NOISE

    @property
    def verdict(self) -> str:
        """Verdict on the cost, then what became better, what worse, and what stayed."""
        sentences = [f"{_VERDICTS[self.change]} ({self.cost.old.value:.3f} -> {self.cost.new.value:.3f})."]
        for change, said in _SAID.items():
            names = [name for name, figure in self.figures.items() if figure.change is change and not figure.too_few]
            if names:
                sentences.append(f"{said}: {', '.join(names)}.")
        if self.success.too_few:
            sentences.append(f"A check on {self.courses} courses tells nothing: {MIN_COURSES} or more are needed.")
        elif self.time_per_m.courses < self.courses:
            sentences.append(self._where_both_arrived)
        return " ".join(sentences)

    @property
    def _where_both_arrived(self) -> str:
        few = ": too few to compare them" if self.time_per_m.too_few else ""
        both = f"{self.time_per_m.courses} of {self.courses} courses on which both machines arrived"
        return f"RMSE, time and steering are those of the {both}{few}."

    def record(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self) | {"within_noise": self.within_noise, "verdict": self.verdict}


def compare(old: Drives, new: Drives, objective: Objective) -> Comparison:
    """Compare the new machine with the old one.

    Args:
        old: drives of the old machine.
        new: drives of the new machine on the same courses, in the same order.
        objective: the cost, of which the weights alone count: drives are pooled by their mean.
    """
    pairs = list(zip(old, new, strict=True))
    only_old = sum(a.success and not b.success for a, b in pairs)
    only_new = sum(b.success and not a.success for a, b in pairs)
    both = [(a, b) for a, b in pairs if a.success and b.success]
    measured = [(a, b) for a, b in both if a.clearance_samples and b.clearance_samples]
    settled = [(a, b) for a, b in both if a.settled_samples and b.settled_samples]
    weights = objective.weights.vector
    return Comparison(
        courses=len(pairs),
        collisions=(_collisions(old), _collisions(new)),
        only_old=only_old,
        only_new=only_new,
        sign_p=sign_test(only_old, only_new),
        success=_success(pairs),
        clearance_rmse_m=_paired(measured, lambda drive: (drive.clearance_rmse, drive.clearance_samples), _rmse),
        settled_rmse_m=_paired(settled, lambda drive: (drive.settled_rmse, drive.settled_samples), _rmse),
        time_per_m=_paired(both, lambda drive: drive.time_s / drive.route_m),
        steering_per_m=_paired(both, lambda drive: drive.steering_travel / drive.route_m),
        cost=_paired(pairs, lambda drive: float(parts(drive) @ weights)),
        cost_parts={name: _paired(pairs, _weighted(k, weights[k])) for k, name in enumerate(PARTS)},
    )


def _weighted(k: int, weight: float) -> Callable[[EpisodeResult], float]:
    """Function of a drive: the k-th part of its cost."""
    return lambda drive: float(parts(drive)[k] * weight)


def _mean(values: Array) -> Statistic:
    return lambda index: values[index].mean(axis=1)


def _rmse(values: Array) -> Statistic:
    """`pooled_rmse` of drives from the RMSE and the number of samples of each, (n, 2)."""
    rmse, samples = values.reshape(-1, 2).T
    return lambda index: pooled_rmse(rmse[index], samples[index])


def _paired(
    pairs: Sequence[tuple[EpisodeResult, EpisodeResult]],
    of: Callable[[EpisodeResult], Any],
    figure: Callable[[Array], Statistic] = _mean,
) -> Paired:
    """Figure over the values `of` the drives; one seed resamples the courses of both machines alike."""
    old, new = (figure(np.array([of(pair[k]) for pair in pairs], float)) for k in (0, 1))
    n = len(pairs)
    return Paired(
        old=bootstrap(old, n),
        new=bootstrap(new, n),
        difference=bootstrap(lambda index: new(index) - old(index), n),
        courses=n,
    )


def _success(pairs: Sequence[tuple[EpisodeResult, EpisodeResult]]) -> Paired:
    plain = _paired(pairs, lambda drive: float(drive.success))
    return Paired(
        old=_rate([a for a, _ in pairs]),
        new=_rate([b for _, b in pairs]),
        difference=plain.difference,
        courses=plain.courses,
        more_is_better=True,
    )


def _rate(drives: Drives) -> Estimate:
    successes = sum(drive.success for drive in drives)
    low, high = wilson(successes, len(drives))
    return Estimate(value=successes / len(drives), low=low, high=high)


def _collisions(drives: Drives) -> int:
    return sum(drive.outcome == "collision" for drive in drives)
