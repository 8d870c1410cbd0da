"""How well a policy drives courses that no training uses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tral_env.interface import Policy
from tral_fsm.evaluation.batch import MAX_ROWS, BatchRunner
from tral_fsm.evaluation.episode import EpisodeRequest
from tral_fsm.evaluation.row_policies import BatchedPolicy

PATIENCE_S = 12.0
"""A car that is stuck for so long has failed (`evaluation.stuck`); one that stands would take a minute to time out."""


ENOUGH = 0.95
"""A PPO that goes on from a policy wants this share of the drives to arrive, or that of the policy if it is more; where
they do, a faster network is better. Source: choice."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """What a validation found."""

    episodes: int
    successes: int
    progress: float
    """Mean share of the route, in [0, 1]."""
    time_s: float | None
    """Mean time of the drives that arrived, s; None: none did."""

    @property
    def success(self) -> float:
        """Share of the drives that arrived."""
        return self.successes / self.episodes

    def is_better_than(self, other: Score | None, enough: int | None = None) -> bool:
        """Whether more drives arrive; where as many do, whether the cars come farther, and then whether faster.

        Args:
            other: what it is compared with; None: nothing.
            enough: where so many drives arrive or more, the faster cars are better; None: more are always better.
        """
        return other is None or self._rank(enough) > other._rank(enough)

    def _rank(self, enough: int | None) -> tuple[int, float, float]:
        time = -math.inf if self.time_s is None else -self.time_s
        if enough is not None and self.successes >= enough:
            return enough, 1.0, time
        return self.successes, round(self.progress, 3), time

    def record(self) -> dict[str, Any]:
        """The score, for JSON."""
        return {
            "episodes": self.episodes,
            "successes": self.successes,
            "progress": round(self.progress, 4),
            "time_s": None if self.time_s is None else round(self.time_s, 2),
        }


class Validation:
    """Drives a policy over the same courses each time; the cars stand ready between two validations."""

    def __init__(self, scenarios: Sequence[str], seeds: Sequence[int], levels: Sequence[str], nthread: int = 1) -> None:
        """Prepare the drives; the families share the seeds' number.

        Args:
            scenarios: families of the courses.
            seeds: one drive each, of each family and on each level.
            levels: how much cars and sensors differ.
            nthread: threads that step the cars.
        """
        self._requests = [EpisodeRequest(0, name, seed) for name in scenarios for seed in seeds]
        rows = min(len(self._requests), MAX_ROWS)
        self._runners = [
            BatchRunner(scenarios, randomization=level, rows=rows, nthread=nthread, stuck_s=PATIENCE_S)
            for level in levels
        ]

    def score(self, policy: Policy) -> Score:
        """Drive all courses."""
        results = [
            result
            for runner in self._runners
            for result in runner.drive_with(lambda world: BatchedPolicy(policy, world.n), self._requests)
        ]
        times_s = [result.time_s for result in results if result.success]
        return Score(
            episodes=len(results),
            successes=len(times_s),
            progress=float(np.mean([result.progress for result in results])),
            time_s=float(np.mean(times_s)) if times_s else None,
        )

    def close(self) -> None:
        """Free the cars."""
        for runner in self._runners:
            runner.close()
