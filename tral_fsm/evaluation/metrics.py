"""Metrics of a drive, tick by tick: from the true values in info, and the clearance that the policy wants."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_fsm.evaluation.episode import outcome
from tral_fsm.evaluation.settling import Settling

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ERROR_BINS = np.linspace(-0.5, 0.5, 101)
"""Edges of the histogram of clearance errors, m; the outermost bins count what lies beyond."""
_SUMS = ("squares", "samples", "settled_squares", "settled_samples", "lateral", "speed", "steering", "ticks")


def true_clearances(info: Mapping[str, Any]) -> tuple[Array, Array]:
    """True distances from the side ultrasonics to the walls.

    Args:
        info: info of n cars after a tick; that of a single environment may lack the clearances.

    Returns:
        (n,) left and (n,) right, m; NaN near doors and corners, and where info lacks them.
    """
    unknown = np.full(1, math.nan)
    return info.get("clearance_left_m", unknown), info.get("clearance_right_m", unknown)


def clearance_error(left: Array, right: Array, wanted: Array) -> Array:
    """Clearance to the followed wall minus the wanted clearance.

    Args:
        left: (n,) true distance to the left wall, m or NaN.
        right: (n,) true distance to the right wall, m or NaN.
        wanted: (n, 2) side (+1 left, -1 right, NaN none) and clearance, m.

    Returns:
        (n,) m; NaN without a wall, or without a wanted clearance.
    """
    side, metres = wanted[:, 0], wanted[:, 1]
    wall = np.where(side > 0, left, np.where(side < 0, right, np.nan))
    error: Array = wall - metres
    return error


class Metrics:
    """Sums over the ticks of n drives, one drive for each row."""

    def __init__(self, n: int) -> None:
        self._sums = {name: np.zeros(n) for name in _SUMS}
        self._errors = np.zeros((n, len(ERROR_BINS) - 1), np.int64)
        self._steering = np.zeros(n)
        self._settling = Settling(n)

    def begin(self, rows: Index) -> None:
        """Set the sums of the rows to 0."""
        for values in (*self._sums.values(), self._steering):
            values[rows] = 0.0
        self._errors[rows] = 0
        self._settling.begin(rows)

    def add(self, rows: Index, info: Mapping[str, Any], wanted: Array, error: Array, steering: Array) -> None:
        """Add a tick.

        Args:
            rows: (k,) rows that drove.
            info: info of all n rows after the tick.
            wanted: (k, 2) side and clearance that the policies want.
            error: (k,) `clearance_error`, m.
            steering: (k,) command, in [-1, 1].
        """
        sums, speed = self._sums, np.asarray(info["speed_mps"][rows], np.float64)
        known = np.isfinite(error)
        settled = self._settling.add(rows, wanted, error, speed)
        for name, counts in (("", known), ("settled_", settled)):
            sums[name + "squares"][rows] += np.where(counts, error, 0.0) ** 2
            sums[name + "samples"][rows] += counts
        bins = np.clip(np.searchsorted(ERROR_BINS, error[known], "right") - 1, 0, len(ERROR_BINS) - 2)
        self._errors[rows[known], bins] += 1
        sums["lateral"][rows] += info["lateral_offset_m"][rows] ** 2
        sums["speed"][rows] += speed
        sums["steering"][rows] += np.abs(steering - self._steering[rows])
        sums["ticks"][rows] += 1
        self._steering[rows] = steering

    def figures(self, row: int, info: Mapping[str, Any]) -> dict[str, Any]:
        """The figures of a row's drive, by the names of `EpisodeResult`.

        Args:
            row: row whose drive has ended.
            info: info of this row after the last tick.
        """
        sums = {name: float(values[row]) for name, values in self._sums.items()}
        ticks = sums["ticks"]
        return {
            "outcome": outcome(info),
            "crash": bool(info["crash"]),
            "progress": float(info["progress"]),
            "time_s": float(info["time_s"]),
            "mean_speed": sums["speed"] / ticks,
            "clearance_rmse": _root_mean(sums["squares"], sums["samples"]),
            "clearance_samples": int(sums["samples"]),
            "settled_rmse": _root_mean(sums["settled_squares"], sums["settled_samples"]),
            "settled_samples": int(sums["settled_samples"]),
            "lateral_rms": math.sqrt(sums["lateral"] / ticks),
            "steering_travel": sums["steering"],
            "gates_passed": int(info["gates_passed"]),
            "gates_total": int(info["gates_total"]),
            "errors": self._errors[row].copy(),
        }


def _root_mean(squares: float, samples: float) -> float:
    return math.sqrt(squares / samples) if samples else math.nan
