"""CMA-ES, for real parameters; it needs the package `cmaes` alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import ConfigError
from tral_fsm.tuning.parameters import Parameter
from tral_fsm.tuning.search.space import Trial, Values, default_population, from_unit, to_unit

Array = NDArray[np.float64]

SIGMA = 0.25
"""Initial standard deviation, share of a range. Source: choice; four of them make the range."""


class CmaSearch:
    """CMA-ES in the unit cube, from the machine's own values on.

    Once it has converged, it starts again at a random point with twice the population.

    Source: IPOP, Auger and Hansen 2005.
    """

    def __init__(self, parameters: Sequence[Parameter], *, seed: int = 0, population: int | None = None) -> None:
        """Begin at the starts of the parameters.

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

        # The package needs at least two dimensions; one that means nothing does no harm.
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
        """Update the distribution, and restart it once it has converged."""
        self._cma.tell([(place, trial.cost) for place, trial in zip(self._asked, trials, strict=True)])
        if self._cma.should_stop():
            self._restart(self._rng.random(len(self.parameters)).tolist(), 2 * self._cma.population_size)
