"""The composite score, by hand."""

from __future__ import annotations

from typing import Any

import pytest
from courses import drive
from hypothesis import given
from hypothesis import strategies as st

from tral_fsm.evaluation.composite import OUTCOME_FACTORS, fate, pace_mps, score, steering_per_m


def record(outcome: str = "success", **changes: Any) -> dict[str, Any]:
    """A drive of 10 m in 10 s without a change of the steering."""
    return drive(outcome, **{"steering_travel": 0.0, **changes}).record()


def test_a_swift_and_calm_success_scores_one() -> None:
    assert score(record()) == 1.0


@pytest.mark.parametrize(
    ("outcome", "crash", "factor"),
    [
        ("timeout", False, 0.7),
        ("missed_gate", False, 0.7),
        ("collision", False, 0.65),
        ("collision", True, 0.5),
    ],
)
def test_a_failure_loses_the_rest_of_the_route_and_its_penalty(outcome: str, crash: bool, factor: float) -> None:
    assert score(record(outcome, crash=crash, progress=0.8, time_s=8.0)) == pytest.approx(0.8 * factor)


@pytest.mark.parametrize(("time_s", "factor"), [(10.0 / 0.6, 1.0), (10.0 / 0.45, 0.9), (10.0 / 0.3, 0.8), (80.0, 0.8)])
def test_a_slow_drive_scores_less(time_s: float, factor: float) -> None:
    assert score(record(time_s=time_s)) == pytest.approx(factor, abs=1e-4)


@pytest.mark.parametrize(("travel", "factor"), [(100.0, 0.95), (200.0, 0.9), (900.0, 0.9)])
def test_a_restless_drive_scores_less(travel: float, factor: float) -> None:
    assert score(record(steering_travel=travel)) == pytest.approx(factor)


def test_pace_and_steering_are_those_along_the_route() -> None:
    half = record("collision", progress=0.5, time_s=10.0, steering_travel=20.0)
    assert pace_mps(half) == 0.5
    assert steering_per_m(half) == 4.0


def test_a_car_that_got_nowhere_has_no_steering_per_metre() -> None:
    assert steering_per_m(record("timeout", progress=0.01, steering_travel=50.0)) is None


def test_every_end_has_a_factor_and_success_the_highest() -> None:
    ends = [record(), record("timeout"), record("missed_gate"), record("collision"), record("collision", crash=True)]
    assert [fate(one) for one in ends] == ["success", "timeout", "missed_gate", "touch", "crash"]
    assert {fate(one) for one in ends} == set(OUTCOME_FACTORS)
    assert max(OUTCOME_FACTORS, key=lambda name: OUTCOME_FACTORS[name]) == "success"


@given(
    st.sampled_from(["success", "timeout", "missed_gate", "collision"]),
    st.floats(0.0, 1.0),
    st.floats(0.1, 200.0),
    st.floats(0.0, 1e4),
    st.floats(1.0, 60.0),
)
def test_the_score_lies_between_0_and_progress(
    outcome: str, progress: float, time_s: float, travel: float, route: float
) -> None:
    one = record(outcome, progress=progress, time_s=time_s, steering_travel=travel, route_m=route)
    assert 0.0 <= score(one) <= one["progress"]
