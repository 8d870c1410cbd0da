"""Policies of any kind in the rows of a batch drive as they do alone."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from courses import FOLLOW_THEN_CRASH, blind

from tral_env.course.layout import Course, Segment
from tral_env.errors import ConfigError, PolicyError
from tral_env.world import Step, World
from tral_fsm.evaluation.batch import BatchRunner
from tral_fsm.evaluation.episode import EpisodeRequest, EpisodeResult
from tral_fsm.evaluation.own_policy import OwnPolicy
from tral_fsm.evaluation.rollout import drive
from tral_fsm.evaluation.row_policies import BatchedPolicy, DriverPool, MixedPolicies, RowPolicies, SinglePolicies
from tral_fsm.runtime.policy import MachinePolicy

SHORT = Course(name="short", segments=(Segment(length=5.0, width=2.0),))


class Swerve:
    """Steers to the left the more, the longer it drives; one that forgets nothing would begin the next drive so."""

    def reset(self, n: int = 1) -> None:
        self._ticks = np.zeros(n)

    def act(self, observation: Any) -> Any:
        self._ticks += 1
        command = np.stack([self._ticks / 200, np.full(len(self._ticks), 0.4)], axis=1)
        return command if np.ndim(observation) == 2 else command[0]


class SwerveRows(Swerve):
    def reset_rows(self, rows: Any) -> None:
        self._ticks[rows] = 0.0


@pytest.fixture(scope="module")
def runner() -> BatchRunner:
    return BatchRunner(["short"], rows=2, randomization="none", course=SHORT)


@pytest.fixture(scope="module")
def swerves() -> list[EpisodeResult]:
    """Three drives in an environment of their own."""
    return alone(OwnPolicy(Swerve()), (1, 2, 3))


def alone(policy: Any, seeds: Sequence[int]) -> list[EpisodeResult]:
    with contextlib.closing(gym.make("tral_env:TralCorridor-v0", course=SHORT, randomization="none")) as env:
        return [drive(env, policy, seed, scenario="short") for seed in seeds]


def requests(*machines: int) -> list[EpisodeRequest]:
    return [EpisodeRequest(machine, "short", seed) for seed, machine in enumerate(machines, 1)]


def same(got: Sequence[EpisodeResult], wanted: Sequence[EpisodeResult]) -> bool:
    return [{name: one.record()[name] for name in two.record()} for one, two in zip(got, wanted, strict=True)] == [
        two.record() for two in wanted
    ]


def test_a_policy_for_many_cars_starts_rows_anew(runner: BatchRunner, swerves: list[EpisodeResult]) -> None:
    got = runner.drive_with(lambda world: BatchedPolicy(SwerveRows(), world.n), requests(0, 0, 0))
    assert same(got, swerves)


def test_a_policy_that_cannot_start_a_row_anew_is_refused_before_it_drives_on(runner: BatchRunner) -> None:
    with pytest.raises(ConfigError, match="policy Swerve cannot start one car while others drive"):
        runner.drive_with(lambda world: BatchedPolicy(Swerve(), world.n), requests(0, 0, 0))


def test_it_may_drive_as_many_cars_as_there_are_rows(runner: BatchRunner, swerves: list[EpisodeResult]) -> None:
    assert same(runner.drive_with(lambda world: BatchedPolicy(Swerve(), world.n), requests(0, 0)), swerves[:2])


def test_a_policy_for_one_car_is_made_once_for_each_row(runner: BatchRunner, swerves: list[EpisodeResult]) -> None:
    made = []

    def make() -> OwnPolicy:
        made.append(OwnPolicy(Swerve()))
        return made[-1]

    assert same(runner.drive_with(lambda world: SinglePolicies(make, world.n), requests(0, 0, 0)), swerves)
    assert len(made) == 2


def test_a_wanted_clearance_of_a_policy_for_one_car_is_measured(runner: BatchRunner) -> None:
    class Wishful(Swerve):
        wanted_clearance = np.array([[-1.0, 0.5]])

    got = runner.drive_with(lambda world: SinglePolicies(lambda: OwnPolicy(Wishful()), world.n), requests(0))
    (wanted,) = alone(OwnPolicy(Wishful()), (1,))
    assert got[0].clearance_samples == wanted.clearance_samples > 100


def test_a_mixture_drives_each_request_with_its_own(runner: BatchRunner, swerves: list[EpisodeResult]) -> None:
    def make(world: World) -> RowPolicies:
        crash = DriverPool([FOLLOW_THEN_CRASH], world.n)
        return MixedPolicies([BatchedPolicy(SwerveRows(), world.n), crash], world.n)

    got = runner.drive_with(make, requests(0, 1, 0))
    assert same([got[0], got[2]], [swerves[0], swerves[2]])
    assert same([got[1]], alone(MachinePolicy(FOLLOW_THEN_CRASH), (2,)))


class Watch:
    def __init__(self) -> None:
        self.ticks: dict[int, int] = {}
        self.finished: list[tuple[int, str]] = []

    def watch(self, rows: Any, numbers: Any, world: World, step: Step) -> None:
        assert len(rows) == len(numbers) <= world.n
        for number in numbers.tolist():
            self.ticks[number] = self.ticks.get(number, 0) + 1

    def finish(self, number: int, result: EpisodeResult) -> None:
        assert result.time_s == pytest.approx(self.ticks[number] / 80)
        self.finished.append((number, result.outcome))


def test_a_spectator_sees_every_tick_and_then_the_result(runner: BatchRunner) -> None:
    seen = Watch()
    runner.drive_with(lambda world: DriverPool([blind(0.9)], world.n), requests(0, 0, 0), spectator=seen)
    assert sorted(seen.finished) == [(0, "collision"), (1, "collision"), (2, "collision")]


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ([[np.nan, 1.0], [0.0, 1.0]], r"policy mine answered \[nan  1.\]: not finite"),
        ([0.0, 1.0], r"policy mine answered commands of shape \(2,\): expected \(2, 2\)"),
    ],
)
def test_an_answer_for_many_cars_that_is_no_command_is_refused(runner: BatchRunner, answer: Any, told: str) -> None:
    class Answers(SwerveRows):
        def act(self, observation: Any) -> Any:
            return np.array(answer)

    with pytest.raises(PolicyError, match=told):
        runner.drive_with(lambda world: BatchedPolicy(Answers(), world.n, "mine"), requests(0, 0))
