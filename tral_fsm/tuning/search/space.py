"""The space of a search, its candidates, and what every searcher can be asked.

A searcher is a pure function of its seed and of what it was told. So a study is continued by telling it the generations
of the file again, and goes on as if it had never been interrupted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from tral_fsm.tuning.parameters import Parameter, Value

Values = tuple[Value, ...]
"""One candidate: a value for each parameter."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One candidate and what it cost."""

    values: Values
    cost: float
    full: bool
    """It has driven all courses, so that its cost can be compared."""
    drives: int
    """How many it has driven."""
    successes: int
    parts: tuple[float, ...]
    """Means of the parts of its cost, in the order of `objective.PARTS`."""

    def record(self) -> dict[str, Any]:
        """As plain values."""
        return {**vars(self), "values": list(self.values), "parts": list(self.parts)}


def trial(record: Mapping[str, Any]) -> Trial:
    """A trial from its record."""
    return Trial(**{**record, "values": tuple(record["values"]), "parts": tuple(record["parts"])})


class Search(Protocol):
    """Asked for a generation, told what it cost, in turn."""

    def ask(self) -> list[Values]:
        """The next candidates."""
        ...

    def tell(self, trials: Sequence[Trial]) -> None:
        """What the candidates of the last `ask` cost."""
        ...


def to_unit(parameter: Parameter, value: Value) -> float:
    """Place of a value in its range, in [0, 1]."""
    low, high, at = parameter.low, parameter.high, float(value)
    if parameter.log:
        low, high, at = math.log(low), math.log(high), math.log(at)
    return min(max((at - low) / (high - low), 0.0), 1.0)


def from_unit(parameter: Parameter, place: float) -> float:
    """Value at a place in [0, 1] of the range; rounded to 4 digits, since more mean nothing for a gain."""
    low, high = parameter.low, parameter.high
    place = min(max(place, 0.0), 1.0)
    value = low * (high / low) ** place if parameter.log else low + (high - low) * place
    return min(max(float(f"{value:.4g}"), low), high)


def default_population(dimensions: int) -> int:
    """Candidates in a generation: 4 + 3 ln n of CMA-ES, at least 12, since drives are noisy and processors many."""
    return max(4 + int(3 * math.log(max(dimensions, 1))), 12)
