"""Where to look next: searchers that are asked for a generation and told what it cost.

A searcher is a pure function of its seed and of what it was told. So a study is continued by telling it the generations
of the file again, and goes on as if it had never been interrupted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import ConfigError
from tral_fsm.tuning.parameters import Parameter, Value

Array = NDArray[np.float64]
Values = tuple[Value, ...]
"""One candidate: a value for each parameter."""

SIGMA = 0.25
"""First spread of CMA-ES, share of a range. Source: choice; the range is 4 of them."""


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


class CmaSearch:
    """CMA-ES in the unit cube, from the machine's own values; when it has come to rest, anew from elsewhere with twice
    the population (IPOP, Auger and Hansen 2005)."""

    def __init__(self, parameters: Sequence[Parameter], *, seed: int = 0, population: int | None = None) -> None:
        """Begin at the parameters' starts.

        Raises:
            ConfigError: a parameter is no real number.
        """
        for parameter in parameters:
            if parameter.kind != "float":
                what = "a whole number" if parameter.kind == "int" else "a choice of " + str(parameter.choices)
                raise ConfigError(f"{parameter.label} is {what}, CMA-ES knows real numbers alone: --sampler tpe")
        self.parameters = list(parameters)
        self.population = population or default_population(len(self.parameters))
        self._rng = np.random.default_rng(seed)
        self._restart([to_unit(each, each.start) for each in self.parameters], self.population)
        self._asked: list[Array] = []

    def _restart(self, middle: Sequence[float], population: int) -> None:
        from cmaes import CMA

        # It wants two dimensions at least: a second one that means nothing does no harm.
        inside = np.clip(np.array([*middle, 0.5][: max(len(middle), 2)], float), 0.02, 0.98)
        self._cma = CMA(
            mean=inside,
            sigma=SIGMA,
            bounds=np.array([[0.0, 1.0]] * len(inside)),
            seed=int(self._rng.integers(2**31)),
            population_size=population,
        )

    def ask(self) -> list[Values]:
        """The next generation."""
        self._asked = [self._cma.ask() for _ in range(self._cma.population_size)]
        return [tuple(map(from_unit, self.parameters, map(float, place))) for place in self._asked]

    def tell(self, trials: Sequence[Trial]) -> None:
        """Move on; start anew when it rests."""
        self._cma.tell([(place, trial.cost) for place, trial in zip(self._asked, trials, strict=True)])
        if self._cma.should_stop():
            self._restart(self._rng.random(len(self.parameters)).tolist(), 2 * self._cma.population_size)
