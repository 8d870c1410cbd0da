"""Networks of Stable-Baselines3 become policies that answer the same; a zip that would run code does not."""

import io
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

import gymnasium as gym
import stable_baselines3 as sb3
import torch

from tral_env.errors import ConfigError, PolicyFileError
from tral_env.learner import LearnerConfig, LearnerView
from tral_fsm.learning.export import network_of, network_of_zip

LEARNER = LearnerConfig(decision_hz=10, observation="features", history=2, detections=False)
INPUTS = LearnerView(LEARNER, 1).size


class Spaces(gym.Env):
    observation_space = gym.spaces.Box(-1, 1, (INPUTS,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (2,), np.float32)


def model(kind: str, **options: Any) -> Any:
    return getattr(sb3, kind)(
        "MlpPolicy", Spaces(), policy_kwargs={"net_arch": [16, 16]}, seed=0, device="cpu", **options
    )


KINDS = [
    ("PPO", "tanh", {}),
    ("PPO", "tanh", {"use_sde": True}),
    ("A2C", "tanh", {}),
    ("SAC", "relu", {"buffer_size": 10}),
]


@pytest.mark.parametrize(("kind", "activation", "options"), KINDS)
def test_the_network_answers_as_the_model_does(kind: str, activation: str, options: dict, tmp_path: Path) -> None:
    trained = model(kind, **options)
    seen = np.random.default_rng(0).uniform(-1, 1, (64, INPUTS)).astype(np.float32)
    expected, _ = trained.predict(seen, deterministic=True)
    direct = network_of(trained.policy.state_dict(), LEARNER, activation=activation)
    assert direct.actions(seen) == pytest.approx(expected, abs=1e-6)
    trained.save(tmp_path / "model.zip")
    read = network_of_zip(tmp_path / "model.zip", LEARNER, activation=activation)
    assert read.actions(seen) == pytest.approx(expected, abs=1e-6)


def test_a_model_with_other_inputs_is_refused() -> None:
    state = model("PPO").policy.state_dict()
    with pytest.raises(ConfigError, match="layer 0 has weights"):
        network_of(state, LearnerConfig(decision_hz=10, observation="features"), activation="tanh")


def test_weights_of_another_kind_are_refused() -> None:
    with pytest.raises(ConfigError, match="expected those of a PPO, A2C or SAC model"):
        network_of({"q_net.0.weight": torch.zeros(2, 2)}, LEARNER, activation="relu")


@pytest.mark.parametrize("zipped", [True, False])
def test_a_zip_that_would_run_code_runs_none(tmp_path: Path, zipped: bool) -> None:
    touched = tmp_path / "touched"

    class Evil:
        def __reduce__(self) -> Any:
            return Path.touch, (touched,)

    content = io.BytesIO()
    torch.save({"action_net.weight": Evil()}, content)
    path = tmp_path / "evil.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("policy.pth", content.getvalue() if zipped else pickle.dumps(Evil()))
        archive.writestr("data", pickle.dumps(Evil()))
    with pytest.raises(PolicyFileError, match="no weights of Stable-Baselines3"):
        network_of_zip(path, LEARNER)
    assert not touched.exists()


def test_a_file_that_is_no_zip_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.zip"
    path.write_bytes(b"PK")
    with pytest.raises(PolicyFileError, match="no weights of Stable-Baselines3"):
        network_of_zip(path, LEARNER)
