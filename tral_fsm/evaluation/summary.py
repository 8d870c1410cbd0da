"""Figures over many episodes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tral_fsm.evaluation.statistics import wilson


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Figures of a set of episodes."""

    episodes: int
    successes: int
    success_rate: float
    success_low: float
    """Lower end of the 95 % interval."""
    success_high: float
    collisions: int
    crashes: int
    """Those of the collisions that were no mere touch."""
    missed_gates: int
    timeouts: int
    progress: float
    """Mean."""
    time_s: float | None
    """Mean over the successes; None without one."""
    mean_speed_mps: float
    """Mean over the episodes, each counting alike, however long it took."""
    clearance_rmse_m: float | None
    """Over all ticks of all episodes; None where no clearance was measured."""
    lateral_rms_m: float | None
    """Mean over the episodes."""
    gates_passed: int
    gates_total: int

    def record(self) -> dict[str, Any]:
        """The figures as a dictionary."""
        return asdict(self)


def summarize(records: Iterable[Mapping[str, Any]]) -> Summary:
    """Bring the records of episodes (`EpisodeResult.record`) into one row of figures."""
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
        clearance_rmse_m=pooled_rmse(rows, "clearance"),
        lateral_rms_m=_mean([row["lateral_rms_m"] for row in rows]),
        gates_passed=sum(row["gates_passed"] for row in rows),
        gates_total=sum(row["gates_total"] for row in rows),
    )


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def pooled_rmse(records: Iterable[Mapping[str, Any]], kind: str) -> float | None:
    """Root of the mean square over all ticks of all episodes.

    Args:
        records: of episodes (`EpisodeResult.record`).
        kind: "clearance", or "settled".

    Returns:
        m; None where none was measured.
    """
    measured = [(row[f"{kind}_samples"], row[f"{kind}_rmse_m"]) for row in records if row[f"{kind}_samples"]]
    samples = sum(count for count, _ in measured)
    if not samples:
        return None
    return math.sqrt(sum(count * rmse**2 for count, rmse in measured) / samples)
