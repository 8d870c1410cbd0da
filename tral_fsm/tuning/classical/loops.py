"""Wall following as data: the gains and the speed of a state, and the response of its cars to a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tral_fsm.tuning.classical.design import Gains

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class WallGains:
    """Gains and speed of a state that follows a wall."""

    name: str
    gains: Gains
    speed: float
    """m/s."""
    place: tuple[str | int, ...] = ()
    """Keys and indices that lead to the state in the definition, as in `parameters.Site`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Response of simulated cars to a step in the wanted clearance."""

    time: Array
    """(k,) time since the step, s."""
    clearance: Array
    """(n, k) true clearance of n cars as a share of the step: 0 before it, 1 wanted after it."""
    step_m: float
    """Height of the step, m."""
    randomization: str = "none"
    """Level at which the cars differ: none, default or hard."""

    @property
    def mean(self) -> Array:
        """(k,) mean over the cars, in which the ultrasonic's jitter averages out."""
        mean: Array = np.nanmean(self.clearance, axis=0)
        return mean
