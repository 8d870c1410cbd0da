"""Names that the options of a drive accept."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from tral_env.course.generate import SCENARIOS
from tral_env.errors import ConfigError, nearest

Camera = Literal["projected", "rendered"]
Randomization = Literal["none", "default", "hard"]


def check_families(names: Iterable[str]) -> list[str]:
    """Names of families, as a list.

    Raises:
        ConfigError: a family is unknown; the message names the nearest.
    """
    chosen = list(names)
    for name in chosen:
        if name not in SCENARIOS:
            raise ConfigError(f"unknown scenario '{name}': {nearest(name, SCENARIOS)}")
    return chosen


def families(text: str) -> list[str]:
    """Families of a text: names, separated by commas, or "all".

    Raises:
        ConfigError: a family is unknown.
    """
    return list(SCENARIOS) if text == "all" else check_families(text.split(","))
