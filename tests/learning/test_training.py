"""A short training of each algorithm: it writes a policy that drives, and goes on where it stopped."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

import yaml

from tral_env.env import TralCorridorEnv
from tral_env.errors import ConfigError
from tral_env.learned import LearnedPolicy
from tral_fsm import load_policy
from tral_fsm.cli import app
from tral_fsm.learning.choices import VALIDATION_SEEDS, TrainRequest, read_settings
from tral_fsm.learning.run import TrainingRun
from tral_fsm.learning.teacher import Samples, TeacherSettings, teacher_settings
from tral_fsm.learning.validation import Score, StuckWatch, Validation
from tral_fsm.policies.corrected import CorrectedPolicy

SMALL: dict[str, dict[str, Any]] = {
    "teacher": {"cars": 3, "layers": [8], "round_decisions": 8, "round_updates": 2, "batch": 16, "samples": 200},
    "ppo": {"cars": 3, "layers": [8], "algorithm": {"n_steps": 8, "batch_size": 24, "n_epochs": 1, "use_sde": True}},
    "sac": {"cars": 3, "layers": [8], "algorithm": {"buffer_size": 500, "learning_starts": 12, "batch_size": 16}},
    "residual": {"cars": 3, "layers": [8], "algorithm": {"n_steps": 8, "batch_size": 24, "n_epochs": 1}},
}
"""Hyper-parameters for trainings of a few seconds."""


def tral(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["train", *map(str, arguments)])


@pytest.fixture
def small(tmp_path: Path) -> Any:
    def write(algo: str) -> Path:
        path = tmp_path / f"{algo}.yaml"
        path.write_text(yaml.safe_dump(SMALL[algo]))
        return path

    return write


@pytest.mark.parametrize("algo", SMALL)
def test_a_training_writes_a_policy_that_drives_and_goes_on(algo: str, small: Any, tmp_path: Path) -> None:
    out = tmp_path / "run"
    options = ("--algo", algo, "--scenario", "straight", "--validation", 1, "--settings", small(algo), "--out", out)
    done = tral(*options, "--steps", 60)
    assert done.exit_code == 0, done.output
    assert f"tral drive --policy {out} --scenario straight" in done.output
    assert (out / "curve.png").stat().st_size > 1000
    first = json.loads((out / "curve.json").read_text())
    assert first[-1]["steps"] >= 60

    policy = load_policy(out)
    assert isinstance(policy, CorrectedPolicy if algo == "residual" else LearnedPolicy)
    about = json.loads((out / "policy.json").read_text())["provenance"]
    assert about["algorithm"] == algo
    assert about["request"]["scenarios"] == ["straight"]
    assert about["validation_seeds"] == "500"
    env = TralCorridorEnv(scenario="straight")
    observation, _ = env.reset(seed=600)
    for _ in range(20):
        observation, *_ = env.step(policy.act(observation))

    again = tral(*options, "--steps", 120, "--resume")
    assert again.exit_code == 0, again.output
    points = json.loads((out / "curve.json").read_text())
    assert points[: len(first)] == first
    assert points[-1]["steps"] >= 120
    other = tral(*options, "--steps", 200, "--resume", "--seed", 1)
    assert other.exit_code == 2
    assert "was trained with seed = 0, got 1" in " ".join(other.output.split())


def test_without_a_checkpoint_there_is_nothing_to_go_on_with(tmp_path: Path) -> None:
    done = tral("--steps", 10, "--resume", "--out", tmp_path)
    assert done.exit_code == 2
    assert "leave --resume out to begin one there" in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"minutes": 1.0, "steps": 5}, "got both --minutes and --steps, or none"),
        ({}, "got both --minutes and --steps, or none"),
        ({"minutes": 0.0}, "--minutes 0.0: expected more than 0"),
        ({"steps": 5, "scenarios": ("corner",)}, "did you mean 'corners'"),
        ({"steps": 5, "algo": "pppo"}, "did you mean 'ppo'"),
        ({"steps": 5, "validation": 500}, "500 episodes of a validation: expected 1 to 200"),
    ],
)
def test_a_request_that_cannot_be_is_refused(arguments: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        TrainRequest(**{"algo": "teacher", "scenarios": ("corners",)} | arguments)


def test_training_courses_lie_beyond_those_of_validations_and_tests() -> None:
    request = TrainRequest(algo="teacher", scenarios=("corners",), steps=1, seed=2)
    assert (request.first_seed, VALIDATION_SEEDS) == (102_000, range(500, 700))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("learning_rat: 0.1", "unknown 'learning_rat': did you mean 'learning_rate'"),
        ("learning_rate: -1", "learning_rate = -1: expected a number above 0"),
        ("average: 1.5", "average = 1.5: expected a number above 0, below 1"),
        ("learner: {decision_hz: 30}", "decision_hz = 30"),
        ("learner: 3", "learner = 3: expected names and values"),
        ("- 1", "expected names and values, such as"),
        ("a: [", "cannot be read"),
    ],
)
def test_settings_that_cannot_be_are_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message):
        read_settings(TeacherSettings, "teacher", path)


def test_only_families_with_gates_or_signs_tell_them_to_the_network() -> None:
    told = {name: teacher_settings((name,)).learner.detections for name in ("corners", "gates", "crossing")}
    assert told == {"corners": False, "gates": True, "crossing": True}
    assert teacher_settings(("corners", "crossing")).learner.detections


class TestSamples:
    def test_the_newest_stay(self) -> None:
        samples, rng = Samples(4, 1), np.random.default_rng(0)
        for value in range(6):
            samples.add(np.full((1, 1), value, np.float32), np.zeros((1, 2), np.float32))
        inputs, _ = samples.draw(samples.window(0), 200, rng)
        assert {*inputs[:, 0].tolist()} == {2.0, 3.0, 4.0, 5.0}

    def test_what_will_make_room_is_not_drawn(self) -> None:
        samples, rng = Samples(4, 1), np.random.default_rng(0)
        for value in range(4):
            samples.add(np.full((1, 1), value, np.float32), np.zeros((1, 2), np.float32))
        inputs, _ = samples.draw(samples.window(2), 200, rng)
        assert {*inputs[:, 0].tolist()} == {2.0, 3.0}


def test_a_validation_finds_what_a_machine_does_and_ends_for_cars_that_stand() -> None:
    class Standing:
        def reset(self, n: int = 1) -> None:
            self.n = n

        def act(self, observation: np.ndarray) -> np.ndarray:
            return np.zeros((self.n, 2), np.float32)

    validation = Validation(("straight",), (500, 501), "none")
    drives = validation.score(load_policy("wall"))
    assert (drives.episodes, drives.successes, drives.progress) == (2, 2, 1.0)
    stands = validation.score(Standing())
    assert (stands.successes, stands.time_s) == (0, None)
    assert drives.is_better_than(stands)
    assert validation.score(load_policy("wall")) == drives
    validation.close()


def test_where_as_many_arrive_the_way_decides() -> None:
    few = Score(episodes=4, successes=1, progress=0.9, time_s=1.0)
    more = Score(episodes=4, successes=2, progress=0.5, time_s=9.0)
    farther = Score(episodes=4, successes=2, progress=0.6, time_s=9.0)
    assert more.is_better_than(few)
    assert farther.is_better_than(more)
    assert not more.is_better_than(more)
    assert few.is_better_than(None)


def test_a_car_is_stuck_that_gains_less_than_a_quarter_metre_in_its_patience() -> None:
    watch = StuckWatch(2, 1.0)
    ways = [([0.1 * k, 0.3 * k], 0.5 * k) for k in range(1, 5)]
    stuck = [watch.stuck(np.array(way), np.full(2, time_s)).tolist() for way, time_s in ways]
    assert stuck == [[False, False], [False, False], [False, False], [False, False]]
    assert watch.stuck(np.array([0.4, 1.5]), np.full(2, 3.0)).tolist() == [True, False]
    watch.reset(np.array([True, False]))
    assert watch.stuck(np.array([0.0, 1.8]), np.array([0.5, 3.5])).tolist() == [False, False]


def test_progress_is_told_until_the_steps_are_used_up(tmp_path: Path) -> None:
    told = []
    request = TrainRequest(algo="teacher", scenarios=("straight",), steps=100, validation=1)
    settings = teacher_settings(("straight",))
    with TrainingRun(request, settings, tmp_path, on_progress=told.append) as run:
        for run.steps in (0, 50, 100):
            run.tell(0.5)
    assert [each.share for each in told] == [0.0, 0.5, 1.0]
    assert run.is_over
