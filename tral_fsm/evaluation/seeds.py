"""Seeds on the command line."""

from __future__ import annotations

from collections.abc import Iterable

from tral_env.checks import is_seed
from tral_env.errors import ConfigError


def parse_seeds(text: str, option: str = "--seeds") -> range:
    """Seeds of a text FIRST:END; END itself is not one of them.

    Args:
        text: the text.
        option: name of the option, for the message.

    Raises:
        ConfigError: the text is not FIRST:END, names no seed, or a seed below 0.
    """
    first, _, end = text.partition(":")
    try:
        seeds = range(int(first), int(end))
    except ValueError:
        raise ConfigError(f"{option} {text}: expected FIRST:END, such as 0:8") from None
    if not seeds or seeds[0] < 0:
        raise ConfigError(f"{option} {text}: expected FIRST:END, FIRST below END, neither below 0")
    return seeds


def check_seeds(name: str, seeds: object) -> None:
    """Refuse what are no seeds in a tuple.

    Raises:
        ConfigError: no tuple, or not all of it are whole numbers, 0 or more.
    """
    if not isinstance(seeds, tuple) or not all(seed is not None and is_seed(seed) for seed in seeds):
        raise ConfigError(f"{name} = {seeds!r}: expected whole numbers, 0 or more, in a tuple such as (0, 1)")


def stretches(seeds: Iterable[int]) -> str:
    """Seeds as a text such as "0 to 9, 1000 to 1049"."""
    ends: list[list[int]] = []
    for seed in sorted(seeds):
        if ends and seed == ends[-1][1] + 1:
            ends[-1][1] = seed
        else:
            ends.append([seed, seed])
    return ", ".join(str(first) if first == last else f"{first} to {last}" for first, last in ends)
