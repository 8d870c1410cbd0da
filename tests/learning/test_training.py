"""A short training of each algorithm: it writes a policy that drives, and goes on where it stopped."""

import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

import torch
import yaml
from stable_baselines3 import PPO

from tral_env.env import TralCorridorEnv
from tral_env.errors import ConfigError, PolicyFileError
from tral_env.learned import LearnedPolicy, Network
from tral_env.learner import LearnerConfig, LearnerView
from tral_env.policy_file import load_network, save
from tral_env.sb3 import make_vec_env
from tral_fsm import load_machine, load_policy
from tral_fsm.cli import app
from tral_fsm.evaluation.stuck import StuckWatch
from tral_fsm.formats import tral_json
from tral_fsm.learning.choices import MAX_CARS, VALIDATION_SEEDS, TrainRequest, read_settings
from tral_fsm.learning.networks import falling
from tral_fsm.learning.reinforcement import reinforcement_settings, settings_for
from tral_fsm.learning.run import TrainingRun, wanted_arrivals
from tral_fsm.learning.start import begin_with, explore, network_to_begin_with
from tral_fsm.learning.student import Samples, Student
from tral_fsm.learning.teacher_settings import TeacherSettings, teacher_settings
from tral_fsm.learning.validation import Score, Validation
from tral_fsm.policies.charted import ChartedPolicy
from tral_fsm.policies.corrected import CorrectedPolicy
from tral_fsm.policies.trained import path_of

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
    kinds = {"residual": CorrectedPolicy, "teacher": ChartedPolicy}
    assert type(policy) is kinds.get(algo, LearnedPolicy)
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


def test_the_learning_rate_of_ppo_falls_with_the_share_that_is_done(small: Any, tmp_path: Path) -> None:
    """24 decisions are an update; of 60 the last one comes after 48, and of 60 more that are gone on with after 108."""
    options = ("--algo", "ppo", "--scenario", "straight", "--validation", 1, "--settings", small("ppo"))
    options += ("--out", tmp_path / "run")
    settings = reinforcement_settings("ppo", ("straight",))
    for more, share in (("--steps", 60), 48 / 60), (("--steps", 120, "--resume"), 108 / 120):
        assert tral(*options, *more).exit_code == 0
        state = torch.load(tmp_path / "run" / "checkpoint.pt", weights_only=True)["state"]
        rate = state["optimizers"]["policy"]["param_groups"][0]["lr"]
        assert rate == pytest.approx(settings.algorithm["learning_rate"] * falling(share, settings.last_rate))


def test_a_learning_rate_falls_along_half_a_cosine() -> None:
    assert [falling(share, 0.1) for share in (0.0, 0.5, 1.0)] == pytest.approx([1.0, 0.55, 0.1])
    assert [falling(share, 1.0) for share in (0.0, 0.3, 1.0)] == [1.0, 1.0, 1.0]


def test_a_training_leaves_no_folder_of_sb3(small: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    options = ("--algo", "ppo", "--scenario", "straight", "--validation", 1, "--settings", small("ppo"))
    assert tral(*options, "--steps", 30, "--out", tmp_path / "run").exit_code == 0
    assert not list((tmp_path / "temporary").glob("SB3-*"))


class TestGoingOnFromAPolicy:
    SMALL_PPO = SMALL["ppo"]["algorithm"]

    @pytest.fixture
    def student(self, small: Any, tmp_path: Path) -> Path:
        out = tmp_path / "student"
        options = ("--scenario", "straight", "--validation", 1, "--settings", small("teacher"), "--out", out)
        assert tral(*options, "--plain", "--steps", 30).exit_code == 0
        return out

    def go_on(self, student: Path, out: Path, critic_first: int) -> Network:
        settings = out.with_suffix(".yaml")
        settings.write_text(yaml.safe_dump({"cars": 3, "critic_first": critic_first, "algorithm": self.SMALL_PPO}))
        options = ("--algo", "ppo", "--scenario", "straight", "--validation", 1, "--settings", settings, "--out", out)
        done = tral(*options, "--from", student, "--steps", 60)
        assert done.exit_code == 0, done.output
        assert json.loads((out / "policy.json").read_text())["provenance"]["request"]["start"] == str(student)
        return load_network(out)

    def test_the_critic_learns_first_and_the_actor_stays_what_it_was(self, student: Path, tmp_path: Path) -> None:
        begun, found = load_network(student), self.go_on(student, tmp_path / "on", 10**6)
        assert found.learner == begun.learner
        for (weight, bias), (before, bias_before) in zip(found.layers, begun.layers, strict=True):
            assert weight == pytest.approx(before, abs=1e-6)
            assert bias == pytest.approx(bias_before, abs=1e-6)

    def test_a_policy_that_follows_a_chart_is_refused_with_the_remedy(self, small: Any, tmp_path: Path) -> None:
        out = tmp_path / "charted"
        options = ("--scenario", "straight", "--validation", 1, "--settings", small("teacher"), "--out", out)
        assert tral(*options, "--steps", 30).exit_code == 0
        done = tral("--algo", "ppo", "--scenario", "straight", "--from", out, "--steps", 60, "--out", tmp_path / "on")
        assert done.exit_code == 2
        told = " ".join(done.output.split())
        assert "it follows a state chart" in told
        assert "train the student with --plain" in told
        assert not (tmp_path / "on").exists()

    def test_the_actor_learns_then(self, student: Path, tmp_path: Path) -> None:
        begun = load_network(student)
        self.go_on(student, tmp_path / "on", 0)
        found = torch.load(tmp_path / "on" / "checkpoint.pt", weights_only=True)["state"]["policy"]
        assert (found["action_net.weight"].numpy() != begun.layers[-1][0]).any()

    def test_the_policy_is_driven_before_the_first_decision(self, student: Path, tmp_path: Path) -> None:
        self.go_on(student, tmp_path / "on", 0)
        points = json.loads((tmp_path / "on" / "curve.json").read_text())
        assert [points[0]["steps"], points[0]["success"]] == [0, None]

    def test_its_noise_has_the_size_that_is_asked_for(self, student: Path) -> None:
        request = TrainRequest(algo="ppo", scenarios=("straight",), steps=1, start=str(student))
        settings = settings_for(request)
        options = {"scenario": "straight", **settings.learner.record()}
        venv = make_vec_env(2, seed=100_000, **options)
        model = PPO(
            "MlpPolicy",
            venv,
            use_sde=True,
            device="cpu",
            policy_kwargs={"net_arch": list(settings.layers), "activation_fn": torch.nn.ReLU},
        )
        begin_with(model, load_network(student))
        explore(model, 0.1)
        venv.seed(100_000)  # the same courses again
        seen = torch.as_tensor(venv.reset())
        deviations = model.policy.get_distribution(seen).distribution.stddev.mean().item()
        venv.close()
        assert deviations == pytest.approx(0.1, rel=0.1)

    def test_a_policy_that_normalizes_its_inputs_becomes_one_that_need_not(self, student: Path) -> None:
        network, rng = load_network(student), np.random.default_rng(0)
        inputs = len(network.layers[0][0][0])
        seen = rng.uniform(-1, 1, (9, inputs)).astype(np.float32)
        normalization = (seen.mean(0), seen.std(0))
        save(replace(network, normalization=normalization), student.with_name("normalized"))
        found = network_to_begin_with(str(student.with_name("normalized")))
        assert found.normalization is None
        assert found.actions(seen) == pytest.approx(
            replace(network, normalization=normalization).actions(seen), abs=1e-5
        )

    @pytest.mark.parametrize("algo", ["teacher", "sac", "residual"])
    def test_other_algorithms_begin_anew(self, algo: str) -> None:
        with pytest.raises(ConfigError, match=f"--from mine with --algo {algo}: ppo alone goes on from a policy"):
            TrainRequest(algo=algo, scenarios=("corners",), steps=1, start="mine")

    def test_a_policy_that_ppo_cannot_be_is_refused(self, tmp_path: Path) -> None:
        learner = LearnerConfig()
        layers = [(np.zeros((2, LearnerView(learner, 1).size), np.float32), np.zeros(2, np.float32))]
        save(Network(learner=learner, layers=layers, output="tanh"), tmp_path)
        request = TrainRequest(algo="ppo", scenarios=("corners",), steps=1, start=str(tmp_path))
        with pytest.raises(ConfigError, match="expected a policy of --algo teacher or ppo"):
            settings_for(request)

    def test_a_policy_that_is_not_there_is_told_with_its_option(self) -> None:
        request = TrainRequest(algo="ppo", scenarios=("corners",), steps=1, start="nosuch")
        with pytest.raises(PolicyFileError, match="--from nosuch: "):
            settings_for(request)

    def test_it_may_be_a_packaged_one(self) -> None:
        settings = settings_for(TrainRequest(algo="ppo", scenarios=("corners",), steps=1, start="ppo"))
        assert settings.learner == load_network(path_of("ppo")).learner


@pytest.mark.parametrize(
    "wrong", [("--randomization", "defualt"), ("--machine", "nosuch"), ("--seed", "1", "--settings", "wrong.yaml")]
)
def test_a_mistyped_option_leaves_an_earlier_training(wrong: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "wrong.yaml").write_text("cars: 2.5")
    (tmp_path / "policy.json").write_text("earlier")
    options = [str(tmp_path / "wrong.yaml") if each == "wrong.yaml" else each for each in wrong]
    done = tral("--steps", 10, "--scenario", "straight", "--out", tmp_path, *options)
    assert done.exit_code == 2, done.output
    assert (tmp_path / "policy.json").read_text() == "earlier"


def test_an_earlier_training_is_set_aside_when_the_first_network_is_validated(tmp_path: Path) -> None:
    (tmp_path / "policy.json").write_text("earlier")
    request = TrainRequest(algo="teacher", scenarios=("straight",), steps=100, validation=1)
    settings = teacher_settings(("straight",))
    with TrainingRun(request, settings, tmp_path) as run:
        assert run.aside is None
        assert (tmp_path / "policy.json").read_text() == "earlier"
        run.validate(Student(settings, "wall", None, 0).network(), {})
    assert run.aside == tmp_path / "before-1"
    assert (tmp_path / "before-1" / "policy.json").read_text() == "earlier"
    assert load_policy(tmp_path)


def test_a_folder_takes_one_training_at_a_time(tmp_path: Path) -> None:
    request = TrainRequest(algo="teacher", scenarios=("straight",), steps=100, validation=1)
    first, second = (TrainingRun(request, teacher_settings(("straight",)), tmp_path) for _ in range(2))
    with first, pytest.raises(ConfigError, match="another training writes into this folder"), second:
        pass


def test_a_machine_that_was_changed_since_is_not_gone_on_with(small: Any, tmp_path: Path) -> None:
    machine, text = tmp_path / "mine.json", tral_json.dumps(load_machine("wall"))
    machine.write_text(text)
    options = ("--scenario", "straight", "--validation", 1, "--settings", small("teacher"), "--machine", machine)
    options += ("--out", tmp_path / "run")
    assert tral(*options, "--steps", 20).exit_code == 0
    machine.write_text(tral_json.dumps(load_machine("corridor")))
    done = tral(*options, "--steps", 40, "--resume")
    assert done.exit_code == 2
    assert "was trained with a machine with sha256 =" in " ".join(done.output.split())


@pytest.mark.parametrize(("part", "name"), [("request", "plain"), ("settings", "chart")])
def test_a_training_of_a_version_that_knew_less_is_not_gone_on_with(part: str, name: str, tmp_path: Path) -> None:
    request = TrainRequest(algo="teacher", scenarios=("straight",), steps=100, validation=1)
    settings = teacher_settings(("straight",))
    with TrainingRun(request, settings, tmp_path) as run:
        run.validate(Student(settings, "wall", None, 0).network(), {})
        run.keep({})
    asked = json.loads((tmp_path / "train.json").read_text())
    del asked[part][name]
    (tmp_path / "train.json").write_text(json.dumps(asked))
    with pytest.raises(ConfigError, match=f"begun by an older version, which knew no {name}: begin anew in another"):
        TrainingRun(request, settings, tmp_path, resume=True)


def test_a_plain_student_has_no_chart(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("chart: true")
    with pytest.raises(ConfigError, match=r"own\.yaml: chart = True with --plain"):
        teacher_settings(("corners",), own, plain=True)
    own.write_text("chart: false")
    assert not teacher_settings(("corners",), own, plain=True).chart


def test_without_a_checkpoint_there_is_nothing_to_go_on_with(tmp_path: Path) -> None:
    done = tral("--steps", 10, "--resume", "--out", tmp_path)
    assert done.exit_code == 2
    assert "leave --resume out to begin one there" in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"minutes": 1.0, "steps": 5}, "got both --minutes and --steps: expected"),
        ({"steps": 5, "algo": "ppo", "plain": True}, "--plain with --algo ppo: its networks see the readings alone"),
        ({}, "got neither --minutes nor --steps: expected"),
        ({"minutes": 0.0}, "--minutes 0.0: expected a finite number above 0"),
        ({"minutes": float("inf")}, "--minutes inf: expected a finite number above 0"),
        ({"steps": 1.5}, "--steps 1.5: expected a whole number, 1 or more"),
        ({"steps": 5, "seed": -5}, "--seed -5: expected a whole number, 0 or more"),
        ({"steps": 5, "validation": True}, "--validation True: expected a whole number"),
        ({"steps": 5, "nthread": 0}, "--nthread 0: expected a whole number, 1 or more"),
        ({"steps": 5, "scenarios": ("corner",)}, "did you mean 'corners'"),
        ({"steps": 5, "algo": "pppo"}, "did you mean 'ppo'"),
        ({"steps": 5, "validation": 500}, "--validation 500: expected 1 to 200"),
        ({"steps": 5, "validation": 1, "randomization": "default,hard"}, "--validation 1: expected 2 to 400"),
        ({"steps": 5, "randomization": "default,hrd"}, "did you mean 'hard'"),
        ({"steps": 5, "randomization": "default,"}, "unknown randomization ''"),
    ],
)
def test_a_request_that_cannot_be_is_refused(arguments: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        TrainRequest(**{"algo": "teacher", "scenarios": ("corners",)} | arguments)


def test_trainings_draw_courses_of_their_own_beyond_those_of_validations_and_tests() -> None:
    starts = [
        TrainRequest(algo="teacher", scenarios=("corners",), steps=1, seed=seed).first_seed(begun)
        for seed in (0, 1, 10**30)
        for begun in range(20)
    ]
    assert min(starts) >= 100_000
    assert max(starts) + MAX_CARS <= 2**31
    assert np.diff(sorted(starts)).min() > MAX_CARS
    assert range(500, 700) == VALIDATION_SEEDS


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("learning_rat: 0.1", "unknown 'learning_rat': did you mean 'learning_rate'"),
        ("learning_rate: -1", "learning_rate = -1.0: expected a number above 0"),
        ("average: 1.5", "average = 1.5: expected a number above 0, below 1"),
        ("learner: {decision_hz: 30}", "decision_hz = 30"),
        ("learner: 3", "learner = 3: expected names and values"),
        ("- 1", "expected names and values, such as"),
        ("a: [", "own.yaml:1:5: not YAML"),
        ("cars: 4\ncars: 8", "own.yaml:2:1: 'cars' stands twice"),
        ("cars: 2.5", r"cars = 2.5: Input should be a valid integer"),
        ("cars: 5000", "cars = 5000: expected 1 to 4096"),
        ("layers: 64", r"layers = 64: Input should be a valid tuple"),
        ("layers: [64, 0]", r"layers = \[64, 0\]: expected at most 15, of 1 to 1024 units each"),
        ("layers: [64, x]", r"layers\[1\] = 'x': Input should be a valid integer"),
        ("activation: gelu", "activation = 'gelu': expected one of relu, tanh"),
    ],
)
def test_settings_that_cannot_be_are_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message):
        read_settings(TeacherSettings, "teacher", path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("last_rate: 1.5", "last_rate = 1.5: expected 0 to 1"),
        ("last_rate: -0.1", "last_rate = -0.1: expected 0 to 1"),
        ("algorithm: {learning_rate: fast}", "algorithm: learning_rate = 'fast': expected a number above 0"),
        ("algorithm: {learning_rate: 0}", "algorithm: learning_rate = 0: expected a number above 0"),
    ],
)
def test_settings_of_ppo_that_cannot_be_are_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message):
        reinforcement_settings("ppo", ("corners",), path)


def test_a_part_of_a_nested_setting_leaves_the_other_parts(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text("learner: {history: 8}\nalgorithm: {gamma: 0.99}\ntask: {gate_reward: 2.0}\ncars: 4")
    own, packaged = (reinforcement_settings("ppo", ("corners",), each) for each in (path, None))
    assert own.learner == replace(packaged.learner, history=8)
    assert own.algorithm == {**packaged.algorithm, "gamma": 0.99}
    assert own.task == {**packaged.task, "gate_reward": 2.0}
    assert own == replace(packaged, learner=own.learner, algorithm=own.algorithm, task=own.task, cars=4)


def test_a_number_without_a_point_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text("learning_rate: 1e-3")
    assert read_settings(TeacherSettings, "teacher", path).learning_rate == 0.001


def test_only_families_with_gates_or_signs_tell_them_to_the_network() -> None:
    told = {name: teacher_settings((name,)).learner.detections for name in ("corners", "gates", "crossing")}
    assert told == {"corners": False, "gates": True, "crossing": True}
    assert teacher_settings(("corners", "crossing")).learner.detections


class TestSamples:
    def test_the_newest_stay(self) -> None:
        samples, rng = Samples(4, 1), np.random.default_rng(0)
        for value in range(6):
            samples.add(np.full((1, 1), value, np.float32), np.zeros((1, 2), np.float32), np.zeros(1, int))
        inputs, _, _ = samples.draw(samples.window(0), 200, rng)
        assert {*inputs[:, 0].tolist()} == {2.0, 3.0, 4.0, 5.0}
        assert samples.newest(3)["inputs"][:, 0].tolist() == [3.0, 4.0, 5.0]
        assert len(samples.newest(9)["answers"]) == 4

    def test_what_will_make_room_is_not_drawn(self) -> None:
        samples, rng = Samples(4, 1), np.random.default_rng(0)
        for value in range(4):
            samples.add(np.full((1, 1), value, np.float32), np.zeros((1, 2), np.float32), np.zeros(1, int))
        inputs, _, _ = samples.draw(samples.window(2), 200, rng)
        assert {*inputs[:, 0].tolist()} == {2.0, 3.0}


def test_a_validation_finds_what_a_machine_does_and_ends_for_cars_that_stand() -> None:
    class Standing:
        def reset(self, n: int = 1) -> None:
            self.n = n

        def act(self, observation: np.ndarray) -> np.ndarray:
            return np.zeros((self.n, 2), np.float32)

    validation = Validation(("straight",), (500, 501), ("none",))
    drives = validation.score(load_policy("wall"))
    assert (drives.episodes, drives.successes, drives.progress) == (2, 2, 1.0)
    stands = validation.score(Standing())
    assert (stands.successes, stands.time_s) == (0, None)
    assert drives.is_better_than(stands)
    assert validation.score(load_policy("wall")) == drives
    validation.close()


def test_a_validation_drives_each_family_on_each_level() -> None:
    validation = Validation(("straight", "corners"), (500,), ("none", "hard"))
    assert validation.score(load_policy("office")).episodes == 4
    validation.close()
    request = TrainRequest(algo="teacher", scenarios=("straight", "corners"), steps=1, randomization="default,hard")
    assert request.levels == ("default", "hard")
    assert len(request.validation_seeds) == 13  # four drives each: 52 of the 50 that are asked for


def test_cars_of_several_levels_train_a_policy_that_remembers(small: Any, tmp_path: Path) -> None:
    options = ("--scenario", "gates", "--randomization", "none,hard", "--validation", 2, "--settings", small("teacher"))
    done = tral(*options, "--plain", "--out", tmp_path / "run", "--steps", 60)
    assert done.exit_code == 0, done.output
    network = load_network(tmp_path / "run")
    assert network.learner.memory
    assert network.chart is None
    assert network.provenance["request"]["randomization"] == "none,hard"


def test_where_as_many_arrive_the_way_decides_and_then_the_time() -> None:
    few = Score(episodes=4, successes=1, progress=0.9, time_s=1.0)
    more = Score(episodes=4, successes=2, progress=0.5, time_s=9.0)
    farther = Score(episodes=4, successes=2, progress=0.6, time_s=9.0)
    assert more.is_better_than(few)
    assert farther.is_better_than(more)
    faster = replace(farther, time_s=8.0)
    assert faster.is_better_than(farther)
    assert not farther.is_better_than(faster)
    assert not more.is_better_than(more)
    assert few.is_better_than(None)


def test_where_enough_arrive_the_faster_one_is_better() -> None:
    begun = Score(episodes=50, successes=49, progress=0.99, time_s=27.0)
    faster, slower = replace(begun, progress=0.98, time_s=25.0), replace(begun, successes=50, time_s=28.0)
    fewer = replace(begun, successes=48, progress=0.99, time_s=20.0)
    assert faster.is_better_than(begun, enough=49)
    assert begun.is_better_than(slower, enough=49)
    assert begun.is_better_than(fewer, enough=49)
    assert replace(fewer, successes=40).is_better_than(replace(begun, successes=39), enough=49)


def test_a_network_that_loses_arrivals_is_not_kept_however_fast(tmp_path: Path) -> None:
    """A training that begins with a policy drives it first, and wants as many drives of it to arrive."""
    request = TrainRequest(algo="ppo", scenarios=("straight",), steps=100, validation=2, start="ppo")
    settings = settings_for(request)
    network = load_network(path_of("ppo"))
    lost = replace(network, layers=[*network.layers[:-1], tuple(0 * each for each in network.layers[-1])])
    with TrainingRun(request, settings, tmp_path) as run:
        begun = run.validate(network, {})
        run.steps = 50
        assert run.validate(lost, {}) != begun
        assert run.best == begun
    assert load_network(tmp_path).layers[-1][0] == pytest.approx(network.layers[-1][0])


@pytest.mark.parametrize(("algo", "wanted"), [("residual", 82), ("ppo", 86)])
def test_a_machine_need_not_arrive_more_often_to_be_corrected(algo: str, wanted: int) -> None:
    """As many as the machine brings home are enough; a policy of PPO is to arrive on 95 % of its drives."""
    begun = Score(episodes=90, successes=82, progress=0.95, time_s=27.6)
    points = [{"steps": 0, "validation": begun.record()}]
    assert wanted_arrivals(points, algo) == wanted
    faster = replace(begun, progress=0.94, time_s=17.9)
    assert faster.is_better_than(begun, wanted) == (algo == "residual")


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
