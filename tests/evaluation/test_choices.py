"""Seeds and families on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import pytest

from tral_env.course.generate import SCENARIOS
from tral_env.errors import ConfigError
from tral_env.options import CAMERAS
from tral_env.randomization import LEVELS
from tral_fsm.evaluation.choices import Camera, Randomization, families, listed
from tral_fsm.evaluation.seeds import parse_seeds, stretches


def test_seeds_are_a_range() -> None:
    assert parse_seeds("1000:1050") == range(1000, 1050)


@pytest.mark.parametrize("text", ["5", "5:5", "a:b", "-1:3"])
def test_other_seeds_are_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="expected FIRST:END"):
        parse_seeds(text)


@pytest.mark.parametrize(
    ("seeds", "told"),
    [((), ""), ((3,), "3"), ((2, 0, 1), "0 to 2"), ((0, 7, 100), "0, 7, 100"), ((5, 0, 1, 6), "0 to 1, 5 to 6")],
)
def test_seeds_are_told_as_stretches(seeds: Sequence[int], told: str) -> None:
    assert stretches(seeds) == told


def test_families_are_named_or_all() -> None:
    assert families("all") == list(SCENARIOS)
    assert families("straight, gates") == ["straight", "gates"]
    with pytest.raises(ConfigError, match="did you mean 'gates'"):
        families("gats")
    with pytest.raises(ConfigError, match="got no scenario"):
        families(" , ")


def test_names_are_separated_by_commas() -> None:
    assert listed(" a,b , ,c") == ["a", "b", "c"]


def test_options_offer_what_the_environment_accepts() -> None:
    assert get_args(Camera) == CAMERAS
    assert get_args(Randomization) == tuple(LEVELS)
