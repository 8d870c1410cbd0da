"""Names that the options of a drive accept."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from tral_env.course.generate import SCENARIOS
from tral_env.course.layout import example_names
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
            raise ConfigError(f"unknown scenario '{name}': {_instead(name)}")
    return chosen


def _instead(name: str) -> str:
    """What to write instead of a name that is no family; a course with a name is none."""
    if name in example_names():
        return f"it is a course, so write --course {name}. Families: {', '.join(SCENARIOS)}"
    return nearest(name, SCENARIOS)


def listed(text: str) -> list[str]:
    """Names that commas separate."""
    return [name.strip() for name in text.split(",") if name.strip()]


def families(text: str) -> list[str]:
    """Families of a text: names, separated by commas, or "all".

    Raises:
        ConfigError: a family is unknown, or none is named.
    """
    names = listed(text)
    if not names:
        raise ConfigError(f"got no scenario: expected all, or some of {', '.join(SCENARIOS)}")
    return list(SCENARIOS) if names == ["all"] else check_families(names)
