"""Many drives at once are the drives one by one."""

from __future__ import annotations

import contextlib
import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from courses import FOLLOW_THEN_CRASH, blind

from tral_env.course.layout import Course, example_path
from tral_env.errors import ConfigError
from tral_fsm import load_machine
from tral_fsm.evaluation.batch import BatchRunner, complete
from tral_fsm.evaluation.episode import EpisodeRequest, EpisodeResult, TickRecorder
from tral_fsm.evaluation.rollout import drive
from tral_fsm.runtime.policy import MachinePolicy

MACHINES = [load_machine("wall"), load_machine("office"), blind(0.5)]
JOBS = [
    EpisodeRequest(2, "doors", 3),
    EpisodeRequest(0, "straight", 3),
    EpisodeRequest(2, "straight", 1),
    EpisodeRequest(1, "doors", 53),
    EpisodeRequest(2, "doors", 5),
]


@pytest.fixture(scope="module")
def runner() -> BatchRunner:
    return BatchRunner(["straight", "doors"], rows=3)


@pytest.fixture(scope="module")
def alone() -> list[dict[str, Any]]:
    """Records of the jobs in an environment of their own."""
    records = []
    for job in JOBS:
        with contextlib.closing(gym.make("tral_env:TralCorridor-v0", scenario=job.scenario)) as env:
            policy = MachinePolicy(MACHINES[job.machine])
            records.append(drive(env, policy, job.seed, scenario=job.scenario).record())
    return records


@pytest.fixture(scope="module")
def far_off(runner: BatchRunner) -> EpisodeResult:
    """A drive along a wall that begins 68 cm beside its clearance."""
    (result,) = runner.drive(MACHINES, [EpisodeRequest(0, "straight", 4)])
    return result


@pytest.mark.parametrize("rows", [2, 3])
def test_each_drive_is_bit_for_bit_the_one_of_the_single_environment(rows: int, alone: list[dict[str, Any]]) -> None:
    drives = BatchRunner(["straight", "doors"], rows=rows).drive(MACHINES, JOBS)
    for result, record in zip(drives, alone, strict=True):
        assert {name: result.record()[name] for name in record} == record


def test_drives_of_a_given_course_are_those_of_the_environment_with_it() -> None:
    course = Course.load(example_path("ring"))
    got = BatchRunner(["mine"], rows=2, course=course).drive(
        MACHINES, [EpisodeRequest(2, "mine", 3), EpisodeRequest(2, "mine", 4)]
    )
    with contextlib.closing(gym.make("tral_env:TralCorridor-v0", course=course)) as env:
        alone = [drive(env, MachinePolicy(MACHINES[2]), seed, scenario="mine").record() for seed in (3, 4)]
    assert [{name: one.record()[name] for name in record} for one, record in zip(got, alone, strict=True)] == alone


def test_steering_travel_adds_up_every_change(runner: BatchRunner) -> None:
    recorder = TickRecorder()
    (got,) = runner.drive([blind(0.5)], [EpisodeRequest(0, "straight", 1)], observers={0: [recorder]})
    steering = recorder.trace().action[:, 0].astype(float)
    assert steering[0] == 0.5  # to the left; later what the car has learnt of its trim is added
    assert got.steering_travel == pytest.approx(np.abs(np.diff(steering, prepend=0.0)).sum())
    assert got.steering_travel > 0.5
    assert (got.outcome, got.clearance_samples) == ("collision", 0)
    assert math.isnan(got.clearance_rmse)


def test_the_histogram_of_errors_counts_every_measured_tick(far_off: EpisodeResult) -> None:
    assert far_off.errors.sum() == far_off.clearance_samples > 100


def test_the_settled_error_leaves_out_the_way_from_a_start_far_off(far_off: EpisodeResult) -> None:
    assert far_off.clearance_rmse > 0.1
    assert far_off.settled_rmse < 0.03
    assert 0.5 * far_off.clearance_samples < far_off.settled_samples < far_off.clearance_samples


def test_a_second_call_finds_the_rows_as_the_first_did(runner: BatchRunner) -> None:
    machines = [FOLLOW_THEN_CRASH, blind(0.5)]
    both = [EpisodeRequest(0, "straight", 3), EpisodeRequest(1, "doors", 3)]
    first = runner.drive(machines, both)
    runner.drive(machines, [EpisodeRequest(1, "straight", 1)])
    assert runner.drive(machines, both) == first


def test_a_car_that_gets_nowhere_is_given_up() -> None:
    patient, hasty = BatchRunner(["straight"], rows=1), BatchRunner(["straight"], rows=1, stuck_s=2.0)
    standing = blind(speed=0.0)
    (early,) = hasty.drive([standing], [EpisodeRequest(0, "straight", 0)])
    assert (early.outcome, early.time_s) == ("timeout", pytest.approx(2.0, abs=0.02))
    ticks: list[int] = []

    def enough(_: int) -> None:
        ticks.append(1)
        if len(ticks) == 300:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):  # still driving after 3.75 s
        patient.drive([standing], [EpisodeRequest(0, "straight", 0)], enough)


def test_the_simulation_has_no_more_rows_than_there_are_drives() -> None:
    runner = BatchRunner(["straight"], rows=3)
    two = runner.prepare(2)
    assert (two.n, runner.prepare(1).n, runner.prepare(5).n) == (2, 2, 3)


def test_a_lost_drive_is_an_error_and_shifts_no_other(far_off: EpisodeResult) -> None:
    assert complete([far_off, far_off]) == [far_off, far_off]
    with pytest.raises(AssertionError, match=r"requests without a result: \[1\]"):
        complete([far_off, None, far_off])


def test_no_jobs_are_no_drives(runner: BatchRunner) -> None:
    assert runner.drive(MACHINES, []) == []


def test_an_unknown_scenario_is_refused() -> None:
    with pytest.raises(ConfigError, match="did you mean 'doors'"):
        BatchRunner(["door"])


def test_the_route_is_as_long_as_the_plan_says(runner: BatchRunner) -> None:
    (got,) = runner.drive([blind(0.5)], [EpisodeRequest(0, "straight", 1)])
    plan = runner.draw(EpisodeRequest(0, "straight", 1))[0].plan
    assert got.route_m == pytest.approx(np.hypot(*np.diff(plan.route, axis=0).T).sum())
