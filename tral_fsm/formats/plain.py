"""The form that each format is read into: a machine as plain JSON values, and the place of each in its file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tral_fsm.definition.checks import Problem

MAX_PROBLEMS = 100
"""Largest number of problems that are reported for a file. Source: choice."""

MIN_PLAIN_STATES = 2
"""A chart with fewer states is told problem by problem. Source: choice."""

_POINTER = re.compile(r"/(?:states|transitions)/\d+")
_PART = re.compile(r".*/(?:states|transitions)/\d+")


class EnoughProblemsError(Exception):
    """A file has `MAX_PROBLEMS` problems, and the search for more ends."""


@dataclass
class Problems:
    """Problems of a file, up to `MAX_PROBLEMS`."""

    found: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    """What is read and does nothing; no problem."""
    plain_chart: str = ""
    """What helps first with a chart in which no state has a type, such as one that another program drew."""

    def complain(self, pointer: str, message: str, place: str = "") -> None:
        """Add a problem.

        Args:
            pointer: JSON pointer to the place; empty for the whole file.
            message: the value that was found, and the allowed ones.
            place: place in words, if it is known already.

        Raises:
            EnoughProblemsError: there are now `MAX_PROBLEMS` problems.
        """
        self.found.append(Problem(pointer, message, place))
        if len(self.found) >= MAX_PROBLEMS:
            raise EnoughProblemsError


@dataclass
class Plain:
    """Content of a file before it is checked."""

    value: Any = None
    """Values as in TRAL JSON."""
    places: dict[str, str] = field(default_factory=dict)
    """JSON pointer into `value` -> place in the file, in words; it holds for all values below it."""


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


def condensed(problems: Problems) -> list[Problem]:
    """What helps first, then the first problem of each part, without the types that there are."""
    parts: dict[str, Problem] = {}
    for problem in problems.found:
        part = _PART.match(problem.pointer)
        short = problem
        if problem.pointer.endswith("/type"):
            short = Problem(problem.pointer, problem.message.partition(":")[0], problem.place)
        parts.setdefault(part[0] if part else f"{problem.place} {problem.message}", short)
    return [Problem("", problems.plain_chart), *parts.values()]
