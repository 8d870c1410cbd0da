"""The space of a search, its candidates, and the protocol of searchers.

A searcher is a pure function of its seed and of the costs that it was told. So it goes on with a study as if it had
never stopped once it was told the generations of the file again.
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
    """One candidate and its cost."""

    values: Values
    cost: float
    full: bool
    """Whether it has driven all courses, so that its cost can be compared."""
    drives: int
    """Number of its drives."""
    successes: int
    parts: tuple[float, ...]
    """Mean of each part of its cost, in the order of `objective.PARTS`."""
    simulated_s: float | None = None
    """Simulated time of its drives, s; None: an older study did not keep it."""

    def record(self) -> dict[str, Any]:
        """As plain values."""
        return {**vars(self), "values": list(self.values), "parts": list(self.parts)}


def trial(record: Mapping[str, Any]) -> Trial:
    """A trial from its record."""
    return Trial(**{**record, "values": tuple(record["values"]), "parts": tuple(record["parts"])})


class Search(Protocol):
    """A searcher: it is asked for a generation and told its costs, in turn."""

    def ask(self) -> list[Values]:
        """The next candidates."""
        ...

    def tell(self, trials: Sequence[Trial]) -> None:
        """Take the costs of the candidates of the last `ask`."""
        ...


def to_unit(parameter: Parameter, value: Value) -> float:
    """Place of a value in the range of its parameter, in [0, 1]."""
    low, high, at = parameter.low, parameter.high, float(value)
    if parameter.log:
        low, high, at = math.log(low), math.log(high), math.log(at)
    return min(max((at - low) / (high - low), 0.0), 1.0)


def from_unit(parameter: Parameter, place: float) -> float:
    """Value at a place in [0, 1] of the range, rounded to 4 digits: a gain needs no more."""
    low, high = parameter.low, parameter.high
    place = min(max(place, 0.0), 1.0)
    value = low * (high / low) ** place if parameter.log else low + (high - low) * place
    return min(max(float(f"{value:.4g}"), low), high)


def default_population(dimensions: int) -> int:
    """Number of candidates of a generation: 4 + 3 ln n as in CMA-ES, at least 12, because drives are noisy."""
    return max(4 + int(3 * math.log(max(dimensions, 1))), 12)
