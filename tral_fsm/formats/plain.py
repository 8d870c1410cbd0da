"""A machine as plain JSON values, and where in its file each of them stands: what every format is read into."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tral_fsm.definition.checks import Problem

MAX_PROBLEMS = 100
"""No more problems of a file are told. Source: choice; nobody reads more."""

_POINTER = re.compile(r"/(?:states|transitions)/\d+")


class EnoughProblemsError(Exception):
    """There are so many problems that it is not worth looking for more."""


@dataclass
class Problems:
    """What is wrong with a file, up to `MAX_PROBLEMS`."""

    found: list[Problem] = field(default_factory=list)

    def complain(self, pointer: str, message: str, place: str = "") -> None:
        """Add one.

        Args:
            pointer: JSON pointer to the place; empty: the whole file.
            message: what was got and what is allowed.
            place: where that is in words, if it is known already.

        Raises:
            EnoughProblemsError: that was the last one.
        """
        self.found.append(Problem(pointer, message, place))
        if len(self.found) >= MAX_PROBLEMS:
            raise EnoughProblemsError


@dataclass
class Plain:
    """What a format makes of a file, before anything is checked."""

    value: Any = None
    """As in TRAL JSON."""
    places: dict[str, str] = field(default_factory=dict)
    """JSON pointer into `value` -> where that stands in the file, in words. Places hold for all that is below them."""


def located(problem: Problem, places: Mapping[str, str]) -> Problem:
    """A problem with its place in words, if the format has words for it."""
    at = problem.pointer
    while at and at not in places:
        at = at.rpartition("/")[0]
    if at not in places or problem.place:
        return problem
    rest = problem.pointer[len(at) :]
    machine = re.sub(r"/(?:states|transitions)/\d+(?:/(?!machine/).*)?$", "", problem.pointer)
    message = _POINTER.sub(lambda found: places.get(machine + found[0], found[0]), problem.message)
    return Problem(problem.pointer, message, f"{places[at]} {rest}".rstrip())
