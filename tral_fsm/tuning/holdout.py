"""The old against the new machine on held-out courses, course by course, with intervals and a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from tral_fsm.evaluation.episode import EpisodeResult
from tral_fsm.evaluation.statistics import Estimate, bootstrap, mean_of, pooled_rmse, sign_test, wilson
from tral_fsm.tuning.objective import Objective

MIN_COURSES = 6
"""Number of courses for a verdict: the sign test gives 2 / 2^5 > 5 % on five, and 2 / 2^6 < 5 % on six."""


class Change(StrEnum):
    """What the search has changed."""

    BETTER = "better"
    WORSE = "worse"
    NOISE = "noise"


_VERDICTS = {
    Change.BETTER: "The tuned machine is better than the old one on courses that it was not tuned on.",
    Change.WORSE: "The tuned machine is worse than the old one on courses that it was not tuned on.",
    Change.NOISE: "The gain is within noise: on other courses the old machine may well be the better one.",
}


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Figures of a machine over its drives."""

    drives: int
    successes: int
    success: Estimate
    """Success rate with Wilson's interval."""
    collisions: int
    clearance_rmse_m: Estimate
    """RMSE over all ticks of all drives, m; bootstrap over drives."""
    settled_rmse_m: Estimate
    """RMSE over the settled ticks, see `tral_fsm.evaluation.settling`, m."""
    time_per_m: Estimate
    """Mean over the drives that arrived, s/m; bootstrap over drives."""
    steering_per_m: Estimate
    cost: Estimate

    def record(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """New minus old on the same courses, cars and noise."""

    old: Figures
    new: Figures
    only_old: int
    """Number of courses on which only the old machine arrived."""
    only_new: int
    """Number of courses on which only the new machine arrived."""
    sign_p: float
    """Probability that luck alone splits these courses as unevenly (exact sign test, McNemar 1947)."""
    cost: Estimate
    """Mean difference; below 0 is better."""
    clearance_m: Estimate
    """Mean difference of the RMSE of drives where both arrived, m."""
    settled_m: Estimate
    """Mean difference of the settled RMSE of drives where both arrived, m."""
    time_per_m: Estimate
    """Mean difference of drives where both arrived, s/m."""

    @property
    def within_noise(self) -> bool:
        """Whether luck may explain the difference: the interval of the cost difference holds 0, or courses are too few.

        On fewer courses than `MIN_COURSES` luck alone improves all of them more than one time in 20.
        """
        return (
            self.old.drives < MIN_COURSES
            or self.cost.low is None
            or self.cost.high is None
            or self.cost.low <= 0.0 <= self.cost.high
        )

    @property
    def change(self) -> Change:
        """Whether the new machine is better, worse, or neither beyond noise."""
        if self.within_noise:
            return Change.NOISE
        return Change.WORSE if (self.cost.value or 0.0) > 0.0 else Change.BETTER

    @property
    def verdict(self) -> str:
        """Verdict as a sentence."""
        return _VERDICTS[self.change]

    def record(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self) | {"within_noise": self.within_noise, "verdict": self.verdict}


def figures(drives: Sequence[EpisodeResult], objective: Objective) -> Figures:
    """Figures over drives of a machine."""
    successes = sum(drive.success for drive in drives)
    low, high = wilson(successes, len(drives))
    return Figures(
        drives=len(drives),
        successes=successes,
        success=Estimate(value=successes / len(drives), low=low, high=high),
        collisions=sum(drive.outcome == "collision" for drive in drives),
        clearance_rmse_m=_pooled([(drive.clearance_rmse, drive.clearance_samples) for drive in drives]),
        settled_rmse_m=_pooled([(drive.settled_rmse, drive.settled_samples) for drive in drives]),
        time_per_m=mean_of([drive.time_s / drive.route_m for drive in drives if drive.success]),
        steering_per_m=mean_of([drive.steering_travel / drive.route_m for drive in drives if drive.success]),
        cost=mean_of(objective.costs(drives).tolist()),
    )


def _pooled(drives: Sequence[tuple[float, int]]) -> Estimate:
    """`pooled_rmse` of drives, from the RMSE and the number of samples of each."""
    rmse, samples = np.array([each for each in drives if each[1]], float).reshape(-1, 2).T
    return bootstrap(lambda index: pooled_rmse(rmse[index], samples[index]), len(rmse))


def compare(old: Sequence[EpisodeResult], new: Sequence[EpisodeResult], objective: Objective) -> Comparison:
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
    return Comparison(
        old=figures(old, objective),
        new=figures(new, objective),
        only_old=only_old,
        only_new=only_new,
        sign_p=sign_test(only_old, only_new),
        cost=mean_of((objective.costs(new) - objective.costs(old)).tolist()),
        clearance_m=mean_of([b.clearance_rmse - a.clearance_rmse for a, b in measured]),
        settled_m=mean_of([b.settled_rmse - a.settled_rmse for a, b in settled]),
        time_per_m=mean_of([(b.time_s - a.time_s) / a.route_m for a, b in both]),
    )
