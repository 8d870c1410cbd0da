"""Which ticks tell how well a clearance is kept."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_fsm.evaluation.settling import ARRIVED_M, MAX_WAY_M, Settling, settled_ticks

RIGHT = (-1.0, 0.5)
NONE = (math.nan, math.nan)
METRE = 80.0
"""Speed of a car that drives a metre a tick, m/s: ticks last 12.5 ms."""


def ticks(error: list[float], speed: float = 0.0, wanted: list[tuple[float, float]] | None = None) -> list[bool]:
    return settled_ticks(np.array(wanted or [RIGHT] * len(error)), np.array(error), np.full(len(error), speed)).tolist()


def test_the_way_to_the_clearance_does_not_count_and_the_overshoot_does() -> None:
    assert ticks([0.4, 0.2, 0.06, 0.05, -0.1, -0.2, 0.0]) == [False, False, False, True, True, True, True]


def test_it_is_reached_from_either_side() -> None:
    assert ticks([-0.3, -0.04, 0.1]) == [False, True, True]


def test_a_car_that_never_arrives_counts_after_four_metres() -> None:
    assert ticks([0.3] * 6, speed=METRE) == [False, False, False, True, True, True]
    assert ticks([0.3] * 6, speed=-METRE) == [False, False, False, True, True, True]


def test_what_is_not_measured_does_not_count_and_does_not_end_it() -> None:
    assert ticks([0.3, 0.0, math.nan, 0.3]) == [False, True, False, True]


@pytest.mark.parametrize("other", [(1.0, 0.5), (-1.0, 0.8)])
def test_another_side_or_clearance_begins_it_anew(other: tuple[float, float]) -> None:
    assert ticks([0.0, 0.0, 0.3, 0.3, 0.0], wanted=[RIGHT, RIGHT, other, other, other]) == [
        True, True, False, False, True,
    ]  # fmt: skip


def test_a_state_that_wants_none_begins_it_anew() -> None:
    wanted = [RIGHT, NONE, RIGHT, RIGHT]
    assert ticks([0.0, math.nan, 0.3, 0.01], wanted=wanted) == [True, False, False, True]
    assert ticks([0.3, math.nan, 0.3, 0.3], speed=2 * METRE, wanted=wanted) == [False, False, False, True]


def test_a_car_at_a_new_start_begins_anew_and_leaves_the_others_alone() -> None:
    cars, both = Settling(2), np.arange(2)
    wanted, still = np.array([RIGHT, RIGHT]), np.zeros(2)
    assert cars.add(both, wanted, np.zeros(2), still).all()
    cars.begin(np.array([1]))
    assert cars.add(both, wanted, np.full(2, 0.3), still).tolist() == [True, False]


@given(
    st.lists(
        st.tuples(
            st.floats(-1.0, 1.0) | st.just(math.nan), st.floats(0.0, 80.0), st.sampled_from([RIGHT, (1.0, 0.4), NONE])
        ),
        min_size=1,
        max_size=40,
    )
)
def test_it_counts_only_from_an_arrival_or_four_metres_on(
    drive: list[tuple[float, float, tuple[float, float]]],
) -> None:
    settled = settled_ticks(
        *(np.array(column) for column in ([d[2] for d in drive], [d[0] for d in drive], [d[1] for d in drive]))
    )
    for k in np.flatnonzero(settled):
        begin = max((i for i in range(1, k + 1) if drive[i][2] != drive[i - 1][2]), default=0)
        since = drive[begin : k + 1]
        near = any(abs(error) <= ARRIVED_M for error, _, _ in since)
        assert near or sum(speed for _, speed, _ in since) / 80.0 >= MAX_WAY_M - 1e-9
