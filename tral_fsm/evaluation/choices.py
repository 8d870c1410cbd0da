"""What a drive can be asked for by name."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from tral_env.course.generate import SCENARIOS
from tral_env.errors import ConfigError, nearest

Camera = Literal["projected", "rendered"]
Randomization = Literal["none", "default", "hard"]


def check_families(names: Iterable[str]) -> list[str]:
    """Families of courses that must be known.

    Raises:
        ConfigError: one is not; the message names the nearest.
    """
    chosen = list(names)
    for name in chosen:
        if name not in SCENARIOS:
            raise ConfigError(f"unknown scenario '{name}': {nearest(name, SCENARIOS)}")
    return chosen


def families(text: str) -> list[str]:
    """Families with commas between them; "all" for all.

    Raises:
        ConfigError: one of them is unknown.
    """
    return list(SCENARIOS) if text == "all" else check_families(text.split(","))
