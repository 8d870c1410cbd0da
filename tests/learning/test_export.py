"""Networks of Stable-Baselines3 become policies that answer the same, or are refused; a zip runs no code."""

import io
import json
import math
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

import gymnasium as gym
import stable_baselines3 as sb3
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from tral_env.errors import ConfigError, PolicyFileError
from tral_env.learner import LearnerConfig, LearnerView
from tral_fsm.learning import sb3_zip
from tral_fsm.learning.export import network_of, network_of_model, network_of_zip

LEARNER = LearnerConfig(decision_hz=10, observation="features", history=2, detections=False)
INPUTS = LearnerView(LEARNER, 1).size
PLANE = gym.spaces.Box(-1, 1, (2,), np.float32)


ROUNDING = 2e-6
"""torch and NumPy sum single precision in other orders: 1.5e-6 apart at most on the processors tried."""


class Spaces(gym.Env):
    observation_space = gym.spaces.Box(-1, 1, (INPUTS,), np.float32)

    def __init__(self, actions: gym.Space = PLANE) -> None:
        self.action_space = actions

    def reset(self, **_: Any) -> Any:
        return self.observation_space.sample(), {}

    def step(self, action: Any) -> Any:
        return self.observation_space.sample(), 0.0, False, False, {}


def model(kind: str, env: Any = None, *, policy: dict[str, Any] | None = None, **options: Any) -> Any:
    """A model with random weights, large enough that tanh and clip differ."""
    sizes = {"net_arch": [16, 16], **(policy or {})}
    made = getattr(sb3, kind)("MlpPolicy", env or Spaces(), policy_kwargs=sizes, seed=0, device="cpu", **options)
    with torch.no_grad():
        for name, values in made.policy.named_parameters():
            if name.startswith(("action_net", "actor.mu")):
                values.mul_(40.0)
    return made


RELU, TANH = {"activation_fn": torch.nn.ReLU}, {"activation_fn": torch.nn.Tanh}
KINDS = [
    ("PPO", "tanh", {}),
    ("PPO", "relu", {"policy": RELU}),
    ("PPO", "tanh", {"use_sde": True}),
    ("PPO", "tanh", {"use_sde": True, "policy": {"squash_output": True}}),
    ("PPO", "tanh", {"use_sde": True, "policy": {"use_expln": True, "full_std": False, "log_std_init": 1.0}}),
    ("PPO", "tanh", {"policy": {"share_features_extractor": False}}),
    ("PPO", "tanh", {"policy": {"net_arch": {"pi": [8], "vf": [32, 32]}}}),
    ("PPO", "tanh", {"policy": {"net_arch": []}}),
    ("A2C", "tanh", {}),
    ("SAC", "relu", {"buffer_size": 10}),
    ("SAC", "tanh", {"buffer_size": 10, "policy": TANH}),
]


@pytest.mark.parametrize(("kind", "activation", "options"), KINDS)
def test_the_network_answers_as_the_model_does(kind: str, activation: str, options: dict, tmp_path: Path) -> None:
    trained = model(kind, **options)
    seen = np.random.default_rng(0).uniform(-1, 1, (64, INPUTS)).astype(np.float32)
    expected, _ = trained.predict(seen, deterministic=True)
    direct = network_of_model(trained, LEARNER, provenance={"by": "me"})
    assert direct.activation == activation
    assert direct.provenance == {"by": "me"}
    assert direct.actions(seen) == pytest.approx(expected, abs=ROUNDING)
    trained.save(tmp_path / "model.zip")
    read = network_of_zip(tmp_path / "model.zip", LEARNER)
    assert read.actions(seen) == pytest.approx(expected, abs=ROUNDING)
    assert network_of_zip(tmp_path / "model.zip", LEARNER, activation=activation).activation == activation


def test_weights_alone_are_told_what_they_do_not_tell() -> None:
    trained = model("PPO", use_sde=True, policy=RELU | {"squash_output": True})
    seen = np.random.default_rng(0).uniform(-1, 1, (8, INPUTS)).astype(np.float32)
    told = network_of(trained.policy.state_dict(), LEARNER, activation="relu", squash_output=True)
    assert told.actions(seen) == pytest.approx(trained.predict(seen, deterministic=True)[0], abs=1e-6)


def test_weights_of_float64_are_rounded() -> None:
    trained = model("PPO")
    seen = np.random.default_rng(0).uniform(-1, 1, (8, INPUTS)).astype(np.float32)
    expected, _ = trained.predict(seen, deterministic=True)
    state = {name: values.double() for name, values in trained.policy.state_dict().items()}
    got = network_of(state, LEARNER, activation="tanh")
    assert all(values.dtype == np.float32 for layer in got.layers for values in layer)
    assert got.actions(seen) == pytest.approx(expected, abs=1e-6)


ELSEWHERE = gym.spaces.Box(np.array([-1, 0], np.float32), np.array([1, 2], np.float32))
REFUSED_MODELS: list[tuple[Callable[[], Any], str]] = [
    (lambda: model("PPO", policy={"activation_fn": torch.nn.ELU}), "(?i)activation_fn elu: expected one of relu, tanh"),
    (lambda: model("PPO", policy={"activation_fn": torch.nn.LeakyReLU}), "(?i)activation_fn leakyrelu"),
    (lambda: model("PPO", Spaces(ELSEWHERE)), r"action space .*: expected Box\(-1, 1, \(2,\)\)"),
    (lambda: model("SAC", Spaces(ELSEWHERE), buffer_size=10), r"action space .*: expected Box\(-1, 1, \(2,\)\)"),
    (lambda: model("PPO", Spaces(gym.spaces.Discrete(2))), "action space|chooses among actions"),
    (lambda: model("SAC", buffer_size=10, use_sde=True), "a mean that is clipped"),
    (lambda: model("TD3", buffer_size=10), "a mean that is clipped|a policy of stable_baselines3.td3"),
    (lambda: model("PPO", policy={"net_arch": [4] * 16}), "17 layers: expected 1 to 16"),
]


@pytest.mark.parametrize(("make", "message"), REFUSED_MODELS)
@pytest.mark.parametrize("zipped", [False, True])
def test_what_a_policy_of_numpy_does_not_do_is_refused(
    make: Callable[[], Any], message: str, zipped: bool, tmp_path: Path
) -> None:
    made = make()
    made.save(tmp_path / "model.zip")
    with pytest.raises(ConfigError, match=message):
        network_of_zip(tmp_path / "model.zip", LEARNER) if zipped else network_of_model(made, LEARNER)


class Doubled(sb3.common.torch_layers.BaseFeaturesExtractor):
    """Has no weights, so the state does not tell it."""

    def __init__(self, space: gym.spaces.Box) -> None:
        super().__init__(space, INPUTS)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return 2.0 * observations


class Weighted(Doubled):
    def __init__(self, space: gym.spaces.Box) -> None:
        super().__init__(space)
        self.linear = torch.nn.Linear(INPUTS, INPUTS)


@pytest.mark.parametrize("zipped", [False, True])
@pytest.mark.parametrize(("kind", "message"), [(Doubled, "features extractor"), (Weighted, "features extractor")])
def test_a_features_extractor_is_refused(kind: type, message: str, zipped: bool, tmp_path: Path) -> None:
    made = model("PPO", policy={"features_extractor_class": kind})
    made.save(tmp_path / "model.zip")
    with pytest.raises(ConfigError, match=message):
        network_of_zip(tmp_path / "model.zip", LEARNER) if zipped else network_of_model(made, LEARNER)


def test_statistics_of_observations_become_part_of_the_policy() -> None:
    venv = VecNormalize(DummyVecEnv([Spaces]), norm_obs=True, clip_obs=math.inf)
    made = model("PPO", venv)
    rng = np.random.default_rng(0)
    venv.obs_rms.update(rng.normal(0.3, 0.02, (50, INPUTS)))
    network = network_of_model(made, LEARNER)
    seen = rng.normal(0.3, 0.02, (20, INPUTS)).astype(np.float32)
    expected, _ = made.predict(venv.normalize_obs(seen), deterministic=True)
    assert network.actions(seen) == pytest.approx(expected, abs=1e-5)


def test_statistics_of_observations_that_are_clipped_are_refused() -> None:
    with pytest.raises(ConfigError, match="clip_obs=10, and a policy file does not clip"):
        network_of_model(model("PPO", VecNormalize(DummyVecEnv([Spaces]))), LEARNER)
    without = model("PPO", VecNormalize(DummyVecEnv([Spaces]), norm_obs=False))
    assert network_of_model(without, LEARNER).normalization is None


def test_a_zip_of_sac_behind_vec_normalize_is_refused(tmp_path: Path) -> None:
    made = model("SAC", VecNormalize(DummyVecEnv([Spaces])), buffer_size=10, learning_starts=100)
    made.learn(2)
    made.save(tmp_path / "model.zip")
    with pytest.raises(ConfigError, match="behind VecNormalize"):
        network_of_zip(tmp_path / "model.zip", LEARNER)


@pytest.mark.parametrize(("given", "message"), [("relu", "tells of the activation tanh, got relu"), ("tnah", "tanh")])
def test_an_activation_that_is_not_that_of_the_file_is_refused(given: str, message: str, tmp_path: Path) -> None:
    model("PPO").save(tmp_path / "model.zip")
    with pytest.raises(ConfigError, match=message):
        network_of_zip(tmp_path / "model.zip", LEARNER, activation=given)


def test_a_model_with_other_inputs_is_refused() -> None:
    state = model("PPO").policy.state_dict()
    with pytest.raises(ConfigError, match="layer 0 has weights"):
        network_of(state, LearnerConfig(decision_hz=10, observation="features"), activation="tanh")


FIRST = "mlp_extractor.policy_net.0.weight"
REFUSED_WEIGHTS: list[tuple[dict[str, Any], str]] = [
    ({FIRST: torch.full((16, INPUTS), torch.nan)}, "not finite"),
    ({FIRST: torch.full((16, INPUTS), 1e300, dtype=torch.float64)}, "not finite"),
    ({FIRST: torch.zeros(16, INPUTS, dtype=torch.int64)}, "expected floating numbers"),
    ({FIRST: torch.zeros(16, INPUTS, dtype=torch.complex64)}, "expected floating numbers"),
    ({FIRST: torch.zeros(16, INPUTS).to_sparse()}, "expected floating numbers"),
    ({FIRST: torch.zeros(16, INPUTS, device="meta")}, "expected floating numbers"),
    ({FIRST: torch.zeros(1).expand(10**6, 10**6)}, "67108864 bytes at most"),
    ({FIRST: torch.zeros(16, INPUTS, 1)}, "expected 2 dimensions"),
    ({FIRST: [[0.0] * INPUTS] * 16}, "got list, expected a tensor"),
    ({FIRST: None}, "got nothing, expected a tensor"),
    ({"mlp_extractor.policy_net.1.weight": torch.zeros(1)}, "hidden layers 0, 1, 2: expected linear layers 0, 2, 4"),
    ({"mlp_extractor.policy_net.x.weight": torch.zeros(1)}, "hidden layers 0, 2, x"),
    ({"mlp_extractor.shared_net.0.weight": torch.zeros(1)}, "layers that actor and critic share"),
    ({"pi_features_extractor.linear.weight": torch.zeros(1)}, "a features extractor with weights"),
    ({"lstm_actor.weight_ih_l0": torch.zeros(1)}, "a recurrent network"),
]


@pytest.mark.parametrize(("changed", "message"), REFUSED_WEIGHTS)
def test_weights_of_another_kind_are_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        network_of(dict(model("PPO").policy.state_dict()) | changed, LEARNER, activation="tanh")


@pytest.mark.parametrize("state", [{}, {"q_net.0.weight": torch.zeros(2, 2)}])
def test_weights_of_no_actor_are_refused(state: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="expected those of a PPO, A2C or SAC model"):
        network_of(state, LEARNER, activation="relu")


@pytest.fixture
def saved(tmp_path: Path) -> dict[str, bytes]:
    """Members of a zip that a model saved."""
    model("PPO").save(tmp_path / "saved.zip")
    with zipfile.ZipFile(tmp_path / "saved.zip") as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(path: Path, members: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def evil(touched: Path) -> Any:
    class Evil:
        def __reduce__(self) -> Any:
            return Path.touch, (touched,)

    return Evil()


@pytest.mark.parametrize("zipped", [True, False])
def test_a_zip_that_would_run_code_runs_none(tmp_path: Path, saved: dict[str, bytes], zipped: bool) -> None:
    touched, content = tmp_path / "touched", io.BytesIO()
    torch.save({"action_net.weight": evil(touched)}, content)
    weights = content.getvalue() if zipped else pickle.dumps(evil(touched))
    with pytest.raises(PolicyFileError, match="no weights of Stable-Baselines3"):
        network_of_zip(packed(tmp_path / "evil.zip", saved | {"policy.pth": weights}), LEARNER)
    assert not touched.exists()


def test_pickles_beside_the_weights_are_left_alone(tmp_path: Path, saved: dict[str, bytes]) -> None:
    """SB3 itself would run those in "data" and in the other files of torch."""
    import base64

    touched, told = tmp_path / "touched", json.loads(saved["data"])
    bomb = pickle.dumps(evil(touched))
    for value in told.values():
        if isinstance(value, dict) and ":serialized:" in value:
            value[":serialized:"] = base64.b64encode(bomb).decode()
    others = {name: bomb for name in saved if name not in ("policy.pth", "data")}
    members = saved | {"data": json.dumps(told).encode(), **others}
    assert network_of_zip(packed(tmp_path / "evil.zip", members), LEARNER).activation == "tanh"
    assert not touched.exists()


@pytest.mark.parametrize("data", [b"\x80\x04.", b"[]", b"[" * 100_000])
def test_data_that_is_no_json_object_is_refused(data: bytes, tmp_path: Path, saved: dict[str, bytes]) -> None:
    with pytest.raises(PolicyFileError, match="data is no JSON of Stable-Baselines3"):
        network_of_zip(packed(tmp_path / "a.zip", saved | {"data": data}), LEARNER)


REFUSED_DATA: list[tuple[dict[str, Any], str]] = [
    ({"policy_class": None}, "a policy of None"),
    ({"policy_class": {"__module__": "mine"}}, "a policy of mine: expected one of stable_baselines3.common"),
    ({"action_space": None}, "action space of shape None"),
    ({"action_space": {"_shape": [2], "low": "[-1. -1.]", "high": "[1. " + "1." * 500 + "]"}}, "action space"),
    ({"action_space": {"_shape": [2], "low": "[-1. -.-1]", "high": "[1. 1.]"}}, "action space"),
    ({"policy_kwargs": {"dropout": 0.5}}, "policy_kwargs dropout: a policy of numpy has no such option"),
    ({"policy_kwargs": {"features_extractor_kwargs": {"a": 1}}}, "features extractor"),
    ({"policy_kwargs": {"activation_fn": "<class 'mine.ReLU'>"}}, "expected a class of torch.nn"),
    ({"policy_kwargs": {"activation_fn": {":serialized:": ""}}}, "expected a class of torch.nn"),
    ({"policy_kwargs": {"squash_output": "no"}}, "squash_output no: expected true or false"),
]


@pytest.mark.parametrize(("changed", "message"), REFUSED_DATA)
def test_options_that_would_make_another_network_are_refused(
    changed: dict[str, Any], message: str, tmp_path: Path, saved: dict[str, bytes]
) -> None:
    data = json.dumps(json.loads(saved["data"]) | changed).encode()
    with pytest.raises(ConfigError, match=message):
        network_of_zip(packed(tmp_path / "a.zip", saved | {"data": data}), LEARNER)


def test_options_that_are_no_object_are_refused(tmp_path: Path, saved: dict[str, bytes]) -> None:
    data = json.dumps(json.loads(saved["data"]) | {"policy_kwargs": [1]}).encode()
    with pytest.raises(PolicyFileError, match="policy_kwargs is no object"):
        network_of_zip(packed(tmp_path / "a.zip", saved | {"data": data}), LEARNER)


def test_a_bomb_is_not_unpacked(tmp_path: Path, saved: dict[str, bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the outer zip by its size, of the weights by being packed at all."""
    with zipfile.ZipFile(io.BytesIO(saved["policy.pth"])) as inner:
        parts = {name: inner.read(name) for name in inner.namelist()}
    weights = packed(tmp_path / "inner.zip", parts | {"zeros": bytes(10**6)}, zipfile.ZIP_DEFLATED).read_bytes()
    with pytest.raises(PolicyFileError, match="packed or overlapping parts"):
        network_of_zip(packed(tmp_path / "a.zip", saved | {"policy.pth": weights}), LEARNER)
    monkeypatch.setattr(sb3_zip, "MAX_ZIP_MEMBER", 10**6)
    bomb = packed(tmp_path / "b.zip", saved | {"policy.pth": bytes(10**7)}, zipfile.ZIP_DEFLATED)
    assert bomb.stat().st_size < 10**5
    with pytest.raises(PolicyFileError, match=r"policy\.pth has more than 1000000 bytes"):
        network_of_zip(bomb, LEARNER)


def test_nothing_is_written_whatever_a_member_is_called(tmp_path: Path, saved: dict[str, bytes]) -> None:
    (tmp_path / "in").mkdir()
    path = packed(tmp_path / "in" / "a.zip", saved | {"../escaped": b"x", "/escaped": b"x"})
    network_of_zip(path, LEARNER)
    assert [one.name for one in (tmp_path / "in").iterdir()] == ["a.zip"]
    assert not (tmp_path / "escaped").exists()


def test_weights_that_are_no_mapping_of_names_are_refused(tmp_path: Path, saved: dict[str, bytes]) -> None:
    for number, found in enumerate(([torch.zeros(2)], {1: torch.zeros(2)})):
        content = io.BytesIO()
        torch.save(found, content)
        path = packed(tmp_path / f"{number}.zip", saved | {"policy.pth": content.getvalue()})
        with pytest.raises(PolicyFileError, match=f"got a {type(found).__name__}"):
            network_of_zip(path, LEARNER)


@pytest.mark.parametrize("content", [b"PK", b""])
def test_a_file_that_is_no_zip_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "model.zip"
    path.write_bytes(content)
    with pytest.raises(PolicyFileError, match="no weights of Stable-Baselines3"):
        network_of_zip(path, LEARNER)


def test_a_folder_or_nothing_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.zip"):
        with pytest.raises(PolicyFileError, match="there is no such file"):
            network_of_zip(path, LEARNER)
