"""A simulated drive and its recording are the same drive: its episode, its physics, the answers of its machine."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from tral_env.errors import BadFileError, ConfigError
from tral_env.hardware.env import TralCarEnv
from tral_env.interface import CORE_LAYOUT
from tral_env.recording.read import Recording, read
from tral_env.recording.recorder import Recorder
from tral_fsm import load_policy
from tral_fsm.evaluation.episode import Episode
from tral_fsm.evaluation.measured import dead_reckoning, figures, measured_trace
from tral_fsm.evaluation.own_policy import find_policy
from tral_fsm.evaluation.policy_files import files_of_policy
from tral_fsm.evaluation.recording import DriveRecorder, episode_of, machine_of
from tral_fsm.evaluation.replay import against_simulation, commands_of, open_loop
from tral_fsm.evaluation.rollout import drive

COURSE = {"name": "two gates", "segments": [{"length": 6.0, "gates": [{"at": 3.0, "id": 1}]}]}


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Episode, Recording]:
    """A drive of the machine `gate` on a car of its own, with noise, and its recording."""
    path = tmp_path_factory.mktemp("drive") / "drive.mcap"
    env = gym.make("tral_env:TralCorridor-v0", course=COURSE, randomization="hard", groups=("imu",))
    policy = load_policy("gate")
    files = files_of_policy("gate", policy)
    with DriveRecorder(path, env, seed=5, scenario="two gates", policy="gate", files=files) as recorder:
        episode = drive(env, policy, 5, on_step=recorder, scenario="two gates")
    env.close()
    return episode, read(path)


def test_the_recording_gives_the_episode_back(driven: tuple[Episode, Recording]):
    episode, recording = driven
    again = episode_of(recording)
    assert again == episode
    for name in ("time", "pose", "speed", "readings", "action", "wanted", "clearance_error", "gates_passed"):
        np.testing.assert_array_equal(getattr(again.trace, name), getattr(episode.trace, name), name)
    assert again.trace.states == episode.trace.states
    assert again.trace.transits == episode.trace.transits
    assert again.trace.transits


def test_the_commands_of_a_simulated_drive_drive_the_simulated_car_just_so(driven: tuple[Episode, Recording]):
    _, recording = driven
    comparison = against_simulation(recording)
    assert comparison.outcome == ""
    for name, told in comparison.record().items():
        assert told["ticks"] > 0, name
        assert told["largest"] == 0.0, name


def test_the_machine_that_drove_answers_what_it_answered(driven: tuple[Episode, Recording]):
    _, recording = driven
    answers = open_loop(recording, load_policy("gate"), "gate")
    assert answers.drove
    assert not answers.difference.any()
    assert answers.record()["steering"] == {"rms": 0.0, "largest": 0.0, "different": 0}


def test_another_machine_answers_otherwise_and_shadows(driven: tuple[Episode, Recording], tmp_path: Path):
    _, recording = driven
    answers = open_loop(recording, load_policy("wall"), "wall")
    assert not answers.drove
    assert answers.difference.any()
    assert not any("stopped" in state for state in answers.states)
    answers.write_csv(tmp_path / "policy.csv")
    with (tmp_path / "policy.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(recording.tick)
    row = rows[100]
    told = float(row["policy_steering"]) - float(row["recorded_steering"])
    assert told == pytest.approx(float(row["difference_steering"]), abs=2e-6)
    assert row["policy_state"] == answers.states[100]


def test_a_policy_of_ones_own_can_be_asked(driven: tuple[Episode, Recording], tmp_path: Path):
    _, recording = driven
    code = tmp_path / "straight.py"
    code.write_text("class Straight:\n    def act(self, observation):\n        return [0.0, 0.25]\n")
    answers = open_loop(recording, find_policy(f"{code}:Straight"), f"{code}:Straight")
    np.testing.assert_array_equal(answers.action, np.tile([0.0, 0.25], (len(recording.tick), 1)))
    assert set(answers.states) == {""}
    assert files_of_policy(f"{code}:Straight", find_policy(f"{code}:Straight")) == {"straight.py": code.read_bytes()}


def test_the_recording_keeps_the_machine_and_what_it_was_driven_with(driven: tuple[Episode, Recording]):
    _, recording = driven
    assert machine_of(recording) == load_policy("gate").definition
    told = recording.configuration
    assert (told["seed"], told["policy"]) == (5, "gate")
    assert told["car"]["friction"] > 0
    np.testing.assert_array_equal(recording.applied, np.clip(recording.action, -1.0, 1.0))


def test_a_tick_that_was_dropped_holds_the_command_before_it(driven: tuple[Episode, Recording]):
    _, whole = driven
    messages = {topic: [one for one in told if one.get("tick") not in (3, 4)] for topic, told in whole.messages.items()}
    gap = Recording(path=whole.path, about=whole.about, files=whole.files, damage="", messages=messages)
    assert len(gap.tick) == len(whole.tick) - 2
    commands = commands_of(gap)
    np.testing.assert_array_equal(commands[3:5], whole.action[[2, 2]])
    np.testing.assert_array_equal(np.delete(commands, [3, 4], 0), np.delete(whole.action, [3, 4], 0))
    assert figures(gap)["missing_ticks"] == 2


def test_a_simulated_drive_that_ends_early_is_told(driven: tuple[Episode, Recording], tmp_path: Path):
    _, recording = driven
    shorter = tmp_path / "shorter.json"
    shorter.write_text('{"name": "shorter", "segments": [{"length": 3.0}]}')
    comparison = against_simulation(recording, course=str(shorter))
    assert comparison.outcome == "success"
    assert np.isnan(comparison.simulated["speed"][-1])


@pytest.fixture
def car(tmp_path: Path) -> Recording:
    """A real car that drove a left circle, with a hall sensor alone."""

    class Hall:
        provided_readings = frozenset({"distance", "speed"})

        def __init__(self) -> None:
            self.distance = 0.0

        def start(self) -> None:
            pass

        def read(self, now: float) -> dict[str, float]:
            self.distance += 0.01
            return {"distance": self.distance, "speed": 0.8}

        def stop(self) -> None:
            pass

    now = [0.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds

    env = TralCarEnv(
        record=tmp_path / "car.mcap", sensors=Hall(), clock=lambda: now[0], sleep=sleep, max_duration_s=4.0
    )
    env.reset()
    for _ in range(200):
        env.step(np.array([0.5, 0.25], np.float32))
    env.close()
    return read(tmp_path / "car.mcap")


def test_a_real_drive_has_figures_and_a_path_by_dead_reckoning(car: Recording):
    told = figures(car)
    assert (told["source"], told["ticks"], told["missing_ticks"]) == ("car", 200, 0)
    assert told["distance_m"] == pytest.approx(1.99, abs=1e-4)
    poses = dead_reckoning(car)
    assert poses[-1, 2] > 1.0  # to the left
    trace = measured_trace(car)
    assert np.isnan(trace.clearance_error).all()
    assert trace.speed[10] == pytest.approx(0.8)


def test_a_real_drive_needs_to_be_told_its_course(car: Recording):
    with pytest.raises(ConfigError, match="--course"):
        against_simulation(car)
    comparison = against_simulation(car, course="short")
    assert comparison.record()["yaw_rate"] == {"rms": None, "largest": None, "ticks": 0}
    assert comparison.record()["speed"]["ticks"] > 0


def test_a_real_drive_has_no_episode(car: Recording):
    with pytest.raises(BadFileError, match="ground truth"):
        episode_of(car)


def test_a_recording_without_a_tick_is_refused(tmp_path: Path):
    with Recorder(tmp_path / "empty.mcap"):
        pass
    empty = read(tmp_path / "empty.mcap")
    for ask in (commands_of, lambda one: open_loop(one, load_policy("wall"), "wall")):
        with pytest.raises(BadFileError, match="no tick"):
            ask(empty)
    assert figures(empty)["mean_speed_mps"] == 0.0


def test_images_of_a_rendered_camera_are_recorded_when_they_are_exposed(tmp_path: Path, opengl: Any):
    env = gym.make("tral_env:TralCorridor-v0", course=COURSE, camera="rendered", max_episode_steps=40)
    with DriveRecorder(tmp_path / "drive.mcap", env, seed=5) as recorder:
        drive(env, load_policy("wall"), 5, on_step=recorder)
    env.close()
    pictures = list(read(tmp_path / "drive.mcap").pictures())
    # 40 ticks are 0.5 s; the camera exposes 15 images in a second.
    assert 7 <= len(pictures) <= 8
    assert pictures[0].pixels().shape == (480, 640, 3)


def test_a_packaged_policy_is_kept_and_known_again(tmp_path: Path) -> None:
    policy = find_policy("student")
    files = files_of_policy("student", policy)
    assert set(files) == {"policy.json", "policy.safetensors"}
    with Recorder(tmp_path / "drive.mcap", files=files) as recorder:
        recorder.tick(time_s=0.0, observation=np.zeros(CORE_LAYOUT.size, np.float32), action=(0.0, 0.0))
    assert open_loop(read(tmp_path / "drive.mcap"), policy, "student").drove
    assert not open_loop(read(tmp_path / "drive.mcap"), find_policy("ppo"), "ppo").drove
