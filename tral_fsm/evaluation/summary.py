"""Figures over many episodes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tral_fsm.evaluation.statistics import pooled_rmse, wilson


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Figures of a set of episodes."""

    episodes: int
    successes: int
    success_rate: float
    success_low: float
    """Lower end of the 95 % interval."""
    success_high: float
    """Upper end of the 95 % interval."""
    collisions: int
    crashes: int
    """Number of collisions that were crashes, not touches."""
    missed_gates: int
    timeouts: int
    progress: float
    """Mean over the episodes, in [0, 1]."""
    time_s: float | None
    """Mean over the successful episodes, s; None without one."""
    mean_speed_mps: float
    """Mean over the episodes with equal weights, m/s."""
    clearance_rmse_m: float | None
    """RMSE over all ticks of all episodes, m; None if no clearance was measured."""
    lateral_rms_m: float | None
    """Mean over the episodes, m."""
    gates_passed: int
    gates_total: int

    def record(self) -> dict[str, Any]:
        """The figures as a dictionary."""
        return asdict(self)


def summarize(records: Iterable[Mapping[str, Any]]) -> Summary:
    """Summarize records of episodes (`EpisodeResult.record`)."""
    rows = list(records)
    outcomes = [row["outcome"] for row in rows]
    successes = outcomes.count("success")
    low, high = wilson(successes, len(rows))
    return Summary(
        episodes=len(rows),
        successes=successes,
        success_rate=successes / len(rows) if rows else 0.0,
        success_low=low,
        success_high=high,
        collisions=outcomes.count("collision"),
        crashes=sum(bool(row["crash"]) for row in rows),
        missed_gates=outcomes.count("missed_gate"),
        timeouts=outcomes.count("timeout"),
        progress=_mean([row["progress"] for row in rows]) or 0.0,
        time_s=_mean([row["time_s"] for row in rows if row["outcome"] == "success"]),
        mean_speed_mps=_mean([row["mean_speed_mps"] for row in rows]) or 0.0,
        clearance_rmse_m=rmse_of(rows, "clearance"),
        lateral_rms_m=_mean([row["lateral_rms_m"] for row in rows]),
        gates_passed=sum(row["gates_passed"] for row in rows),
        gates_total=sum(row["gates_total"] for row in rows),
    )


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def rmse_of(records: Iterable[Mapping[str, Any]], kind: str) -> float | None:
    """Root of the mean square of the clearance error over all ticks of all episodes.

    Args:
        records: records of episodes (`EpisodeResult.record`).
        kind: "clearance", or "settled" for settled ticks alone.

    Returns:
        RMSE, m; None without a measured tick.
    """
    measured = [(row[f"{kind}_rmse_m"], row[f"{kind}_samples"]) for row in records if row[f"{kind}_samples"]]
    if not measured:
        return None
    rmse, samples = np.array(measured, float).T
    return float(pooled_rmse(rmse, samples))
