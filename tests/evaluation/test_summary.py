"""Figures over many episodes."""

from __future__ import annotations

from typing import Any

import pytest

from tral_fsm.evaluation.summary import summarize


def record(outcome: str = "success", **changes: Any) -> dict[str, Any]:
    return {
        "outcome": outcome,
        "crash": False,
        "progress": 1.0,
        "time_s": 10.0,
        "mean_speed_mps": 0.5,
        "clearance_rmse_m": None,
        "clearance_samples": 0,
        "lateral_rms_m": 0.1,
        "gates_passed": 0,
        "gates_total": 0,
        **changes,
    }


def test_outcomes_are_counted() -> None:
    rows = [record(), record("collision", crash=True), record("collision"), record("missed_gate"), record("timeout")]
    summary = summarize(rows)
    assert (summary.episodes, summary.successes, summary.success_rate) == (5, 1, 0.2)
    assert (summary.collisions, summary.crashes, summary.missed_gates, summary.timeouts) == (2, 1, 1, 1)


def test_the_time_is_that_of_successes() -> None:
    assert summarize([record(), record("collision", time_s=1.0)]).time_s == 10.0
    assert summarize([record("collision", time_s=1.0)]).time_s is None


def test_clearance_errors_are_pooled_over_ticks() -> None:
    rows = [
        record(clearance_rmse_m=0.03, clearance_samples=100),
        record(clearance_rmse_m=0.06, clearance_samples=300),
        record(),
    ]
    assert summarize(rows).clearance_rmse_m == pytest.approx(((100 * 0.03**2 + 300 * 0.06**2) / 400) ** 0.5)


def test_gates_are_added_up() -> None:
    summary = summarize([record(gates_passed=1, gates_total=2), record(gates_passed=2, gates_total=2)])
    assert (summary.gates_passed, summary.gates_total) == (3, 4)


def test_no_episodes_give_no_figures() -> None:
    summary = summarize([])
    assert (summary.episodes, summary.success_rate, summary.clearance_rmse_m) == (0, 0.0, None)
