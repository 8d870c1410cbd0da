"""Suites of the benchmark: families of courses x levels of randomization, with seeds that are kept apart.

| split | seeds | used for |
| --- | --- | --- |
| train | 100000 and up | training |
| validation | 500 to 699 | choosing among what was trained or tuned |
| test | 5000 and up | the published figures, and nothing before them |

Other seeds are free: machines are tuned on them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from tral_env.course.generate import SCENARIOS
from tral_env.errors import ConfigError, nearest

SPLITS: Mapping[str, range] = {
    "train": range(100_000, 2**31),
    "validation": range(500, 700),
    "test": range(5000, 100_000),
}
"""Split -> its seeds."""


def split_of(seed: int) -> str | None:
    """Name of the split of a seed; None: it belongs to none."""
    return next((name for name, seeds in SPLITS.items() if seed in seeds), None)


def require_no_test_seeds(seeds: Iterable[int], option: str) -> None:
    """Refuse to prepare a policy on test courses.

    Raises:
        ConfigError: a seed belongs to the test split.
    """
    for seed in seeds:
        if split_of(seed) == "test":
            raise ConfigError(
                f"{option}: {seed} is a seed of the test courses, which are for published figures alone: expected "
                f"seeds below {SPLITS['test'].start}, or {SPLITS['train'].start} and up"
            )


@dataclass(frozen=True, kw_only=True)
class Suite:
    """What every contender drives: each family on each level, on the same seeds."""

    name: str
    families: tuple[str, ...]
    """Families of courses."""
    levels: tuple[str, ...]
    """Levels of randomization."""
    split: str
    """Split of the seeds; they begin with its first one."""
    courses: int
    """Number of courses of each task, which is a family on a level."""
    camera: str = "projected"

    @property
    def seeds(self) -> range:
        """Seeds of the courses of each task."""
        return SPLITS[self.split][: self.courses]

    @property
    def tasks(self) -> list[tuple[str, str]]:
        """Family and level of each task."""
        return [(family, level) for level in self.levels for family in self.families]

    def with_courses(self, courses: int | None) -> Suite:
        """The suite with another number of courses; None: as it is.

        Raises:
            ConfigError: the split has not that many seeds.
        """
        if courses is None:
            return self
        if not 1 <= courses <= len(SPLITS[self.split]):
            raise ConfigError(f"--courses {courses}: expected 1 to {len(SPLITS[self.split])}: the {self.split} split")
        return replace(self, courses=courses)

    def record(self) -> dict[str, Any]:
        """The suite for JSON."""
        return {
            "name": self.name,
            "families": list(self.families),
            "levels": list(self.levels),
            "split": self.split,
            "seeds": [self.seeds[0], self.seeds[-1] + 1],
            "camera": self.camera,
        }


SUITES: Mapping[str, Suite] = {
    suite.name: suite
    for suite in (
        Suite(name="smoke", families=("straight", "corners"), levels=("default",), split="validation", courses=4),
        Suite(name="corners", families=("corners",), levels=("default", "hard"), split="test", courses=100),
        Suite(name="standard", families=tuple(SCENARIOS), levels=("default", "hard"), split="test", courses=200),
    )
}
"""The suites by name. The time limit of a course is that of the environment: its length / (0.3 m/s) + 10 s."""


def suite(name: str) -> Suite:
    """A suite by its name.

    Raises:
        ConfigError: there is no such suite.
    """
    if name not in SUITES:
        raise ConfigError(f"unknown suite '{name}': {nearest(name, SUITES)}")
    return SUITES[name]
