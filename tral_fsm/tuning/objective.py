"""What a drive costs: a weighted sum of parts that each mean something, and one number out of many drives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import ConfigError, nearest
from tral_fsm.evaluation.episode import EpisodeResult

Array = NDArray[np.float64]
Pooling = Literal["mean", "worst", "cvar"]
POOLINGS: tuple[Pooling, ...] = ("mean", "worst", "cvar")
PARTS = ("failure", "unfinished", "clearance", "time", "steering")


@dataclass(frozen=True, kw_only=True)
class Weights:
    """What a unit of each part costs. Source of all: choice; a failed drive is worse than any that arrives."""

    failure: float = 10.0
    """For a drive that does not arrive."""
    unfinished: float = 10.0
    """For the whole route; a drive that fails halfway pays half of it, so that later is better."""
    clearance: float = 20.0
    """For a metre of clearance RMSE: 5 cm cost 1."""
    time: float = 0.5
    """For a second a metre: 1 m/s costs 0.5, 0.5 m/s costs 1."""
    steering: float = 0.05
    """For steering travel over a metre: full right to full left and back is 4."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, int | float) or not math.isfinite(value) or value < 0.0:
                raise ConfigError(f"Weights.{field.name} = {value!r}: expected a finite number, 0 or more")

    @property
    def vector(self) -> Array:
        """(5,) in the order of `PARTS`."""
        return np.array([getattr(self, name) for name in PARTS], float)

    def record(self) -> dict[str, float]:
        """As a dictionary."""
        return asdict(self)


def parts(drive: EpisodeResult) -> Array:
    """The parts of a drive's cost, (5,) in the order of `PARTS`, not weighted.

    Without a measured clearance that part is 0. Time and steering are taken over the metres that were driven, at
    least 1 m.
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
    """One number out of many drives."""

    weights: Weights = Weights()
    pooling: Pooling = "mean"
    """mean; worst: the most costly drive; cvar: the mean over the most costly `tail` of them, so that gains are
    good on unlucky cars too."""
    tail: float = 0.25

    def __post_init__(self) -> None:
        if self.pooling not in POOLINGS:
            raise ConfigError(f"unknown objective '{self.pooling}': {nearest(self.pooling, POOLINGS)}")
        if not 0.0 < self.tail <= 1.0:
            raise ConfigError(f"Objective.tail = {self.tail!r}: expected a share above 0, at most 1")

    def costs(self, drives: Sequence[EpisodeResult]) -> Array:
        """Cost of each drive, (k,)."""
        return np.array([parts(drive) for drive in drives]).reshape(-1, len(PARTS)) @ self.weights.vector

    def pool(self, costs: Array) -> float:
        """One number out of the costs of drives, (k,)."""
        if self.pooling == "mean":
            return float(np.mean(costs))
        if self.pooling == "worst":
            return float(np.max(costs))
        count = max(math.ceil(self.tail * len(costs) - 1e-9), 1)
        return float(np.mean(np.sort(costs)[-count:]))

    def cost(self, drives: Sequence[EpisodeResult]) -> float:
        """One number out of drives."""
        return self.pool(self.costs(drives))
