"""Wall following as data: a state with its gains and speed, and its driven response to a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tral_fsm.tuning.classical.design import Gains

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class WallState:
    """Gains and speed of a state that follows a wall."""

    name: str
    gains: Gains
    speed: float
    """m/s."""
    place: tuple[str | int, ...] = ()
    """Where the state stands in the definition, as `parameters.Site` has it."""


@dataclass(frozen=True, kw_only=True)
class Response:
    """A step in the wanted clearance, driven."""

    time: Array
    """(k,) s, 0 at the step."""
    clearance: Array
    """(n, k) true clearance of n cars as a share of the step: 0 before, 1 wanted after."""

    @property
    def mean(self) -> Array:
        """(k,) mean over the cars; the ultrasonic's jitter averages out."""
        mean: Array = np.nanmean(self.clearance, axis=0)
        return mean
