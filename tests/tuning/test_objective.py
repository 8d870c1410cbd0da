"""What drives cost, and what a race and a comparison make of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from courses import drive
from hypothesis import given
from hypothesis import strategies as st

from tral_env.errors import ConfigError
from tral_fsm.evaluation.episode import EpisodeResult
from tral_fsm.tuning.holdout import Change, compare
from tral_fsm.tuning.objective import Objective, Weights, parts


def test_the_parts_are_what_they_say() -> None:
    assert parts(drive()) == pytest.approx([0.0, 0.0, 0.03, 1.0, 0.5])
    assert parts(drive("collision", progress=0.25, time_s=5.0)) == pytest.approx([1.0, 0.75, 0.03, 2.0, 2.0])


def test_a_drive_without_a_measured_clearance_pays_nothing_for_it() -> None:
    assert parts(drive(clearance_rmse=math.nan, clearance_samples=0))[2] == 0.0


def test_the_cost_is_the_weighted_sum() -> None:
    assert Objective().costs([drive()]) == pytest.approx([20 * 0.03 + 0.5 * 1.0 + 0.05 * 0.5])
    only = Objective(weights=Weights(failure=0, unfinished=0, clearance=0, time=1, steering=0))
    assert only.cost([drive(time_s=12.0), drive(time_s=14.0)]) == pytest.approx(1.3)


def test_failing_later_is_better_and_arriving_best() -> None:
    early, late, arrived = drive("collision", progress=0.2), drive("collision", progress=0.9), drive()
    costs = Objective().costs([early, late, arrived])
    assert costs[0] > costs[1] > costs[2] + 10.0


@pytest.mark.parametrize(("pooling", "cost"), [("mean", 2.5), ("worst", 4.0), ("cvar", 3.5)])
def test_drives_are_pooled_by_their_mean_the_worst_or_the_mean_of_the_worst_half(pooling: str, cost: float) -> None:
    objective = Objective(pooling=pooling, tail=0.5)  # type: ignore[arg-type]
    assert objective.pool(np.array([3.0, 1.0, 4.0, 2.0])) == cost


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=20))
def test_cvar_lies_between_mean_and_worst(costs: list[float]) -> None:
    mean, cvar, worst = (Objective(pooling=name).pool(np.array(costs)) for name in ("mean", "cvar", "worst"))  # type: ignore[arg-type]
    assert mean <= cvar + 1e-9
    assert cvar <= worst + 1e-9


def test_weights_below_0_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"Weights.time = -1: expected a finite number, 0 or more"):
        Weights(time=-1)


def test_the_same_drives_are_within_noise() -> None:
    drives = [drive(seed=k, time_s=10.0 + k) for k in range(20)]
    same = compare(drives, drives, Objective())
    assert same.within_noise
    assert (same.cost.difference.value, same.only_old, same.only_new, same.sign_p) == (0.0, 0, 0, 1.0)
    assert "within noise" in same.verdict


def test_a_gain_on_every_course_is_seen_however_much_courses_differ() -> None:
    rng = np.random.default_rng(0)
    hard = rng.uniform(0.01, 0.2, 20)
    old = [drive(seed=k, clearance_rmse=each + 0.01) for k, each in enumerate(hard)]
    new = [drive(seed=k, clearance_rmse=each) for k, each in enumerate(hard)]
    found = compare(old, new, Objective())
    rmse = found.clearance_rmse_m
    assert rmse.difference.high is not None
    assert rmse.difference.high < 0.0
    assert "cost of the tuned machine is lower" in found.verdict
    assert "cost of the tuned machine is higher" in compare(new, old, Objective()).verdict


def test_courses_that_only_one_machine_arrives_on_are_counted() -> None:
    old = [drive(), drive("collision"), drive("timeout"), drive()]
    new = [drive(), drive(), drive(), drive("collision")]
    found = compare(old, new, Objective())
    assert (found.only_old, found.only_new) == (1, 2)
    assert (found.success.old.value, found.success.new.value, found.success.difference.value) == (0.5, 0.75, 0.25)


def test_the_rmse_of_many_drives_counts_ticks() -> None:
    long, short = drive(clearance_rmse=0.02, clearance_samples=300), drive(clearance_rmse=0.06, clearance_samples=100)
    got = compare([long, short], [long, short], Objective()).clearance_rmse_m.old.value
    assert got == pytest.approx(math.sqrt((300 * 0.02**2 + 100 * 0.06**2) / 400))


def test_the_settled_error_is_compared_beside_the_whole_one() -> None:
    old = [drive(seed=k, settled_rmse=0.04) for k in range(4)]
    new = [
        drive(seed=0, settled_rmse=math.nan, settled_samples=0),
        *(drive(seed=k, settled_rmse=0.03) for k in (1, 2, 3)),
    ]
    found = compare(old, new, Objective())
    settled = found.settled_rmse_m
    assert (settled.old.value, settled.new.value, settled.difference.value) == pytest.approx((0.04, 0.03, -0.01))
    assert found.clearance_rmse_m.difference.value == 0.0


def test_a_few_courses_are_too_few_for_a_verdict_even_if_all_get_better() -> None:
    old, new = ([drive(seed=k, clearance_rmse=each) for k in range(6)] for each in (0.05, 0.03))
    assert "cost of the tuned machine is lower" in compare(old, new, Objective()).verdict
    few = compare(old[:5], new[:5], Objective())
    assert few.within_noise
    assert few.verdict.endswith("). A check on 5 courses tells nothing: 6 or more are needed.")


MIXED = (
    [drive(seed=k, clearance_rmse=0.05, steering_travel=400.0) for k in range(8)],
    [drive(seed=k, clearance_rmse=0.055, steering_travel=100.0) for k in range(8)],
)
"""Drives of an old and a new machine: it steers less, and keeps its clearance worse."""


def test_the_verdict_says_what_got_better_and_what_got_worse() -> None:
    found = compare(*MIXED, Objective())
    assert found.verdict == (
        "The cost of the tuned machine is lower on drives that it was not tuned on "
        f"({found.cost.old.value:.3f} -> {found.cost.new.value:.3f}). Better: steering. Worse: clearance RMSE. "
        "No clear change: success, settled RMSE, time."
    )


def test_the_parts_of_the_cost_add_up_to_it() -> None:
    found = compare(*MIXED, Objective())
    assert list(found.cost_parts) == ["failure", "unfinished", "clearance", "time", "steering"]
    for of in ("old", "new", "difference"):
        whole = sum(getattr(part, of).value for part in found.cost_parts.values())
        assert whole == pytest.approx(getattr(found.cost, of).value)


def test_every_difference_is_new_minus_old_also_where_drives_fail_or_differ_in_length() -> None:
    rng = np.random.default_rng(1)
    old, new = (
        [
            drive(
                str(rng.choice(["success", "collision"], p=[0.8, 0.2])),
                seed=k,
                clearance_rmse=rng.uniform(0.01, 0.2),
                clearance_samples=int(rng.integers(1, 500)),
                time_s=rng.uniform(5.0, 20.0),
                steering_travel=rng.uniform(0.0, 50.0),
            )
            for k in range(30)
        ]
        for _ in range(2)
    )
    found = compare(old, new, Objective())
    for figure in (found.cost, *found.figures.values(), *found.cost_parts.values()):
        assert None not in (figure.old.value, figure.new.value)
        assert figure.difference.value == pytest.approx(figure.new.value - figure.old.value)  # type: ignore[operator]


def test_more_arrivals_are_better_and_less_of_anything_else() -> None:
    failing, arriving = [drive("collision", seed=k) for k in range(8)], [drive(seed=k) for k in range(8)]
    assert compare(failing, arriving, Objective()).success.change is Change.BETTER
    assert compare(arriving, failing, Objective()).success.change is Change.WORSE
    assert compare(failing, arriving, Objective()).time_per_m.difference.value is None  # nothing to compare


def test_figures_of_fewer_than_six_courses_where_both_arrived_are_neither_better_nor_worse() -> None:
    def drives(arrived: int, **figures: float) -> list[EpisodeResult]:
        return [drive("success" if k < arrived else "collision", seed=k, **figures) for k in range(40)]

    old = drives(5, clearance_rmse=0.05, time_s=20.0)
    found = compare(old, drives(30, clearance_rmse=0.049, time_s=19.9), Objective())
    assert found.time_per_m.courses == 5
    assert found.verdict.endswith(
        "). Better: success. RMSE, time and steering are those of the 5 of 40 courses on which both machines arrived: "
        "too few to compare them."
    )

    more = compare(drives(8), drives(7), Objective())
    assert more.verdict.endswith("those of the 7 of 40 courses on which both machines arrived.")
