"""A trained network as a policy: it decides as torch does, and sees as in the environment in which it learned."""

from itertools import pairwise

import numpy as np
import pytest
from rows import row_among_others
from threadpoolctl import threadpool_limits

from tral_env.env import TralCorridorEnv
from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT, check_readings
from tral_env.learned import BLAS, Correction, LearnedPolicy, Network
from tral_env.learner import LearnerConfig, LearnerView

LEARNER = LearnerConfig(decision_hz=20, observation="features", history=4, action="speed", drive_range=(0.2, 1.0))


def network(learner: LearnerConfig = LEARNER, hidden: int = 16, seed: int = 0, **options: object) -> Network:
    rng = np.random.default_rng(seed)
    sizes = [LearnerView(learner, 1).size, hidden, 2]
    layers = [
        (rng.normal(0, a**-0.5, (b, a)).astype(np.float32), rng.normal(0, 0.1, b).astype(np.float32))
        for a, b in pairwise(sizes)
    ]
    return Network(learner=learner, layers=layers, **options)  # type: ignore[arg-type]


def nothing_seen(n: int = 1) -> np.ndarray:
    return CORE_LAYOUT.missing(n).astype(np.float32)


def test_a_perceptron_by_hand() -> None:
    learner = LearnerConfig()
    first = np.zeros((2, CORE_LAYOUT.size), np.float32)
    first[0, 0], first[1, 1] = 1.0, -1.0
    layers = [
        (first, np.float32([0.5, 0.25])),
        (np.float32([[1.0, 2.0], [0.0, 1.0]]), np.float32([0.0, -3.0])),
    ]
    seen = np.zeros((1, CORE_LAYOUT.size), np.float32)
    seen[0, :2] = 0.25, 0.125  # relu: 0.75, 0.125
    assert Network(learner=learner, layers=layers).actions(seen).tolist() == [[1.0, -1.0]]
    soft = Network(learner=learner, layers=layers, activation="tanh", output="tanh").actions(seen)
    hidden = np.tanh([0.75, 0.125])
    assert soft[0] == pytest.approx(np.tanh([hidden[0] + 2 * hidden[1], hidden[1] - 3.0]), abs=1e-6)


def test_inputs_are_normalized_if_the_network_says_so() -> None:
    learner = LearnerConfig()
    layers = [(np.ones((2, CORE_LAYOUT.size), np.float32), np.zeros(2, np.float32))]
    mean, std = np.full(CORE_LAYOUT.size, 2.0, np.float32), np.full(CORE_LAYOUT.size, 4.0, np.float32)
    seen = np.full((1, CORE_LAYOUT.size), 2.0, np.float32)
    seen[0, 0] = 3.0
    assert Network(learner=learner, layers=layers, normalization=(mean, std)).actions(seen).tolist() == [[0.25, 0.25]]


@pytest.mark.parametrize(("activation", "output"), [("relu", "clip"), ("tanh", "tanh")])
def test_it_decides_as_torch_does(activation: str, output: str) -> None:
    torch = pytest.importorskip("torch")
    net = network(hidden=256, activation=activation, output=output)
    layers = []
    for weight, bias in net.layers:
        linear = torch.nn.Linear(weight.shape[1], weight.shape[0])
        linear.weight.data, linear.bias.data = torch.from_numpy(weight), torch.from_numpy(bias)
        layers += [linear, torch.nn.ReLU() if activation == "relu" else torch.nn.Tanh()]
    # In double precision: in single, a second thread of torch may compute a tanh that is wrong by 3e-5.
    rival = torch.nn.Sequential(*layers[:-1], torch.nn.Hardtanh() if output == "clip" else torch.nn.Tanh()).double()
    seen = np.random.default_rng(1).uniform(-1, 1, (256, LearnerView(LEARNER, 1).size)).astype(np.float32)
    with torch.no_grad():
        expected = rival(torch.from_numpy(seen).double()).numpy()
    assert net.actions(seen) == pytest.approx(expected, abs=1e-6)
    assert np.concatenate([net.actions(row[None]) for row in seen]) == pytest.approx(expected, abs=1e-6)


def test_many_rows_are_computed_in_one_thread_and_the_number_of_threads_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[list[int]] = []

    def noted(x: np.ndarray) -> np.ndarray:
        seen.append(blas_threads())
        return x

    def blas_threads() -> list[int]:
        return [each["num_threads"] for each in BLAS.info()]

    monkeypatch.setattr("tral_env.learned.ACTIVATIONS", {"relu": noted})
    with threadpool_limits(2, "blas"):
        network().actions(np.zeros((8, LearnerView(LEARNER, 1).size), np.float32))
        assert blas_threads() == [2] * len(seen[0])
    assert seen == [[1] * len(seen[0])]


@pytest.mark.parametrize("action", ["speed", "throttle"])
def test_over_plain_readings_it_drives_as_in_the_environment_in_which_it_learned(action: str) -> None:
    learner = LearnerConfig(decision_hz=10, observation="features", history=3, spacing_s=0.05, action=action)
    net = network(learner)
    policy = LearnedPolicy(net)
    learning = TralCorridorEnv(scenario="crossing", **learner.record() | {"drive_range": None})
    plain = TralCorridorEnv(scenario="crossing")
    seen, _ = learning.reset(seed=3)
    readings, _ = plain.reset(seed=3)
    ended = False
    for _ in range(40):
        seen, _, *ends, info = learning.step(net.actions(seen[None])[0])
        for _ in range(learner.decision_ticks):
            readings, _, *end, told = plain.step(policy.act(readings))
            if any(end):
                break
        assert told["pose"].tolist() == info["pose"].tolist()
        assert end == ends
        ended = any(end)
        if ended:
            break
    assert ended or info["time_s"] == pytest.approx(4.0)


def test_a_row_among_others_is_driven_as_alone_also_when_rows_begin_anew() -> None:
    ticks = list(row_among_others(LearnedPolicy(network()), LearnedPolicy(network()), 4, "straight"))
    assert len(ticks) == 400


def test_a_distance_that_fell_begins_a_new_episode() -> None:
    policy, fresh = LearnedPolicy(network()), LearnedPolicy(network())
    readings = nothing_seen()[0]
    for way in (0.0, 0.5, 1.0):
        readings[CORE_LAYOUT.column("distance")] = way
        readings[CORE_LAYOUT.column("ultrasonic_left")] = 1.0 + way
        policy.act(readings)
    start = nothing_seen()[0]
    assert policy.act(start).tolist() == fresh.act(start).tolist()


def test_predict_is_that_of_stable_baselines() -> None:
    policy = LearnedPolicy(network())
    action, state = policy.predict(nothing_seen(3), "kept", episode_start=np.ones(3, bool))
    assert action.shape == (3, 2)
    assert state == "kept"
    assert policy.predict(nothing_seen(3)[:2], episode_start=np.ones(2, bool))[0].shape == (2, 2)
    with pytest.raises(ConfigError, match=r"observation has shape \(3, 20\), expected \(2, 20 or more\)"):
        policy.predict(nothing_seen(3))


def test_it_says_which_readings_it_needs() -> None:
    class Car:
        provided_readings = frozenset(name for name in CORE_LAYOUT.names if not name.startswith(("gate", "marker")))

    blind = LearnerConfig(observation="features", detections=False)
    check_readings(LearnedPolicy(network(blind)), Car())
    with pytest.raises(ConfigError, match="the policy needs gate_id"):
        check_readings(LearnedPolicy(network()), Car())


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("ultrasonic_left", 6.5, r"ultrasonic_left = 6.5 in row 0, allowed 0 to 6 m: .* not normalized"),
        ("speed", -1.3, "speed = -1.3"),
        ("gate_x", np.nan, "gate_x = nan"),
    ],
)
def test_readings_that_none_can_be_are_refused(name: str, value: float, message: str) -> None:
    readings = nothing_seen()[0]
    readings[CORE_LAYOUT.column(name)] = value
    with pytest.raises(ConfigError, match=message):
        LearnedPolicy(network()).act(readings)


def test_features_are_refused_where_readings_are_wanted() -> None:
    with pytest.raises(ConfigError, match="the policy makes its features itself"):
        LearnedPolicy(network()).act(np.zeros((2, 112), np.float32))


def test_a_decision_that_is_not_finite_is_refused() -> None:
    inputs = LearnerView(LEARNER, 1).size
    huge = [(np.full((4, inputs), 3e38, np.float32), np.zeros(4, np.float32))]
    huge += [(np.float32([[1, -1, 1, -1]] * 2), np.zeros(2, np.float32))]
    with np.errstate(all="ignore"), pytest.raises(ConfigError, match="a number that is not finite"):
        LearnedPolicy(Network(learner=LEARNER, layers=huge)).act(nothing_seen()[0])


@pytest.mark.parametrize("observation", ["abc", [["x"]], None, 3.0])
def test_what_is_no_array_of_readings_is_refused(observation: object) -> None:
    with pytest.raises(ConfigError, match="observation"):
        LearnedPolicy(network()).act(observation)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"layers": []}, "0 layers: expected 1 to 16"),
        ({"layers": [(np.zeros((2, 5), np.float32), np.zeros(2, np.float32))]}, r"layer 0 has weights \(2, 5\)"),
        ({"layers": [([[0.0]], [0.0])]}, "weights of layer 0: got list, expected an array of float32"),
        ({"layers": [(np.zeros((2, 112)), np.zeros(2))]}, "weights of layer 0: got array of float64"),
        ({"layers": [(np.full((2, 112), np.nan, np.float32), np.zeros(2, np.float32))]}, "layer 0: .* not finite"),
        (
            {"normalization": (np.zeros(112, np.float32),) * 2},
            "standard deviation .*: expected 1e-06 or more",
        ),
        ({"correction": Correction(machine="{}", steering=0.1, speed=0.1)}, "a correction has action='throttle'"),
        ({"activation": "gelu"}, "unknown activation 'gelu'"),
        ({"output": "none"}, "unknown output 'none'"),
        ({"normalization": (np.zeros(3, np.float32),) * 2}, r"mean of the inputs has shape \(3,\): expected \(112,\)"),
    ],
)
def test_a_network_whose_parts_do_not_fit_is_refused(change: dict, message: str) -> None:
    whole = network()
    parts = {"learner": LEARNER, "layers": whole.layers} | change
    with pytest.raises(ConfigError, match=message):
        Network(**parts)
