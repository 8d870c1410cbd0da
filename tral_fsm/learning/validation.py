"""How well a policy drives courses that no training uses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from tral_env.interface import Policy
from tral_env.options import CorridorConfig
from tral_env.world import World

PATIENCE_S = 5.0
"""A car that gains less than `STUCK_M` in this time has failed; a car that stands would take a minute to time out."""
STUCK_M = 0.25


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

    def is_better_than(self, other: Score | None) -> bool:
        """Whether more drives arrive; where as many do, whether the cars come farther."""
        return other is None or (self.successes, self.progress) > (other.successes, other.progress)

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

    def __init__(self, scenarios: Sequence[str], seeds: Sequence[int], randomization: str, nthread: int = 1) -> None:
        """Prepare the drives; the families share the seeds' number.

        Args:
            scenarios: families of the courses.
            seeds: one drive each, of each family.
            randomization: how much cars and sensors differ.
            nthread: threads that step the cars.
        """
        self._seeds = list(seeds)
        self._worlds = [
            World(len(self._seeds), CorridorConfig(scenario=name, randomization=randomization), nthread=nthread)
            for name in scenarios
        ]

    def score(self, policy: Policy) -> Score:
        """Drive all courses."""
        found = [self._drive(world, policy) for world in self._worlds]
        success, progress, time_s = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return Score(
            episodes=len(success),
            successes=int(success.sum()),
            progress=float(progress.mean()),
            time_s=float(time_s[success].mean()) if success.any() else None,
        )

    def _drive(self, world: World, policy: Policy) -> tuple[Any, Any, Any]:
        """Success, progress and time of each drive, (n,)."""
        rows = np.arange(world.n)
        world.reset(world.request(rows), [seeding.np_random(seed)[0] for seed in self._seeds])
        policy.reset(world.n)
        watch = StuckWatch(world.n, PATIENCE_S)
        success, progress, time_s = np.zeros(world.n, bool), np.zeros(world.n), np.zeros(world.n)
        driving = np.ones(world.n, bool)
        observation = world.observation()
        while driving.any():
            step = world.step(policy.act(observation), np.flatnonzero(driving))
            observation = step.observation
            stuck = watch.stuck(step.info["progress"] * world.track.length, step.info["time_s"])
            ended = driving & (step.terminated | step.truncated | stuck)
            success[ended] = step.info["success"][ended]
            progress[ended], time_s[ended] = step.info["progress"][ended], step.info["time_s"][ended]
            driving &= ~ended
        return success, progress, time_s

    def close(self) -> None:
        """Free the cars."""
        for world in self._worlds:
            world.close()


class StuckWatch:
    """Finds cars that make no way."""

    def __init__(self, n: int, patience_s: float) -> None:
        self._patience_s = patience_s
        self._best, self._since = np.zeros(n), np.zeros(n)

    def reset(self, rows: Any) -> None:
        """Begin anew in some rows."""
        self._best[rows] = self._since[rows] = 0.0

    def stuck(self, gained_m: Any, time_s: Any) -> Any:
        """(n,) cars that gained less than `STUCK_M` along their routes in the patience.

        Args:
            gained_m: (n,) way along the route, m.
            time_s: (n,) time since reset, s.
        """
        ahead = gained_m > self._best + STUCK_M
        self._best = np.where(ahead, gained_m, self._best)
        self._since = np.where(ahead, time_s, self._since)
        return time_s - self._since > self._patience_s
