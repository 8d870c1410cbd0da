"""Suites and the seeds that they keep apart."""

from __future__ import annotations

from itertools import combinations

import pytest

from tral_env.course.generate import SCENARIOS
from tral_env.errors import ConfigError
from tral_fsm.evaluation.suites import SPLITS, SUITES, require_no_test_seeds, split_of, suite


def test_no_seed_belongs_to_two_splits() -> None:
    for one, other in combinations(SPLITS.values(), 2):
        assert one.stop <= other.start or other.stop <= one.start


@pytest.mark.parametrize(
    ("seed", "split"),
    [
        (499, None), (500, "validation"), (699, "validation"), (700, None), (4999, None),
        (5000, "test"), (99_999, "test"), (100_000, "train"),
    ],
)  # fmt: skip
def test_each_seed_knows_its_split(seed: int, split: str | None) -> None:
    assert split_of(seed) == split


@pytest.mark.parametrize("name", SUITES)
def test_the_seeds_of_a_suite_lie_in_its_split(name: str) -> None:
    one = suite(name)
    assert len(one.seeds) == one.courses
    assert {split_of(seed) for seed in one.seeds} == {one.split}


def test_the_standard_suite_is_the_one_of_the_published_tables() -> None:
    standard = suite("standard")
    assert (standard.families, standard.levels) == (tuple(SCENARIOS), ("default", "hard"))
    assert (standard.seeds, standard.split) == (range(5000, 5200), "test")
    assert standard.tasks[:2] == [("straight", "default"), ("doors", "default")]
    assert len(standard.tasks) == 18


def test_fewer_courses_are_the_first_ones() -> None:
    assert suite("standard").with_courses(3).seeds == range(5000, 5003)
    assert suite("standard").with_courses(None) == suite("standard")


def test_a_suite_never_grows_into_other_splits() -> None:
    with pytest.raises(ConfigError, match=r"--courses 201: expected 1 to 200: the validation split"):
        suite("smoke").with_courses(201)


def test_an_unknown_suite_is_refused() -> None:
    with pytest.raises(ConfigError, match="unknown suite 'standart': did you mean 'standard'"):
        suite("standart")


def test_nothing_is_prepared_on_test_courses() -> None:
    require_no_test_seeds([0, 7, 650, 4999, 100_000], "--seeds")
    with pytest.raises(ConfigError, match="--seeds: 5000 is a seed of the test courses"):
        require_no_test_seeds(range(4990, 5010), "--seeds")
