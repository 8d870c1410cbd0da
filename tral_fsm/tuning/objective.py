"""The cost of a drive, a weighted sum of five parts, and the cost of many drives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tral_env.checks import check_number
from tral_env.errors import ConfigError, nearest
from tral_fsm.evaluation.episode import EpisodeResult
from tral_fsm.tuning.choices import POOLINGS, Pooling

Array = NDArray[np.float64]
PARTS = ("failure", "unfinished", "clearance", "time", "steering")


@dataclass(frozen=True, kw_only=True)
class Weights:
    """Cost of a unit of each part. Source of all: choice; a failed drive costs more than any that arrives."""

    failure: float = 10.0
    """Cost of a drive that does not arrive."""
    unfinished: float = 10.0
    """Cost of the whole route; a drive that fails halfway pays half of it, so that a later failure costs less."""
    clearance: float = 20.0
    """Cost of a metre of clearance RMSE: 5 cm cost 1."""
    time: float = 0.5
    """Cost of a second for each metre: 1 m/s costs 0.5, 0.5 m/s costs 1."""
    steering: float = 0.05
    """Cost of a unit of steering travel for each metre; from full right to full left and back is 4 units."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            check_number(f"Weights.{field.name}", value)
            if value < 0.0:
                raise ConfigError(f"Weights.{field.name} = {value!r}: expected a finite number, 0 or more")

    @property
    def vector(self) -> Array:
        """(5,) in the order of `PARTS`."""
        return np.array([getattr(self, name) for name in PARTS], float)

    def record(self) -> dict[str, float]:
        """As a dictionary."""
        return asdict(self)


def parts(drive: EpisodeResult) -> Array:
    """Parts of a drive's cost without weights, (5,) in the order of `PARTS`.

    The part of the clearance is 0 if it was not measured. Time and steering are divided by the driven metres, at least
    1 m.
    """
    driven = max(drive.progress * drive.route_m, 1.0)
    failed = not drive.success
    return np.array(
        [
            float(failed),
            1.0 - drive.progress if failed else 0.0,
            0.0 if math.isnan(drive.clearance_rmse) else drive.clearance_rmse,
            drive.time_s / driven,
            drive.steering_travel / driven,
        ]
    )


@dataclass(frozen=True, kw_only=True)
class Objective:
    """Cost of many drives as one number."""

    weights: Weights = Weights()
    pooling: Pooling = "mean"
    """Pooling of the drives: their mean, the worst of them, or cvar, the mean over the worst `tail` of them."""
    tail: float = 0.25
    """Share of the drives that cvar counts, in (0, 1]."""

    def __post_init__(self) -> None:
        if self.pooling not in POOLINGS:
            raise ConfigError(f"unknown objective '{self.pooling}': {nearest(self.pooling, POOLINGS)}")
        if not 0.0 < self.tail <= 1.0:
            raise ConfigError(f"Objective.tail = {self.tail!r}: expected a share above 0, at most 1")

    def costs(self, drives: Sequence[EpisodeResult]) -> Array:
        """Cost of each drive, (k,)."""
        return np.array([parts(drive) for drive in drives]).reshape(-1, len(PARTS)) @ self.weights.vector

    def pool(self, costs: Array) -> float:
        """Pool the costs of drives, (k,)."""
        if self.pooling == "mean":
            return float(np.mean(costs))
        if self.pooling == "worst":
            return float(np.max(costs))
        count = max(math.ceil(self.tail * len(costs) - 1e-9), 1)
        return float(np.mean(np.sort(costs)[-count:]))

    def cost(self, drives: Sequence[EpisodeResult]) -> float:
        """Cost of drives."""
        return self.pool(self.costs(drives))
