"""A network corrects a machine: its steering by an addend, the speed that it regulates by a factor."""

import json
from pathlib import Path

import numpy as np
import pytest

from tral_env import policy_file
from tral_env.env import TralCorridorEnv
from tral_env.errors import ConfigError, MachineError, PolicyFileError
from tral_env.learned import Correction, Network
from tral_env.learner import LearnerConfig, LearnerView
from tral_env.vector_env import TralCorridorVectorEnv
from tral_fsm import load_policy
from tral_fsm.formats import library, tral_json
from tral_fsm.policies.corrected import CorrectedPolicy

LEARNER = LearnerConfig(decision_hz=10, observation="features", history=2)
DOORS = tral_json.dumps(library.load("doors"))


def constant(steering: float, speed: float, bound: float = 0.5) -> Network:
    """A network whose answers are always the same."""
    weights = np.zeros((2, LearnerView(LEARNER, 1).size), np.float32)
    layers = [(weights, np.array([steering, speed], np.float32))]
    return Network(learner=LEARNER, layers=layers, correction=Correction(machine=DOORS, steering=0.2, speed=bound))


def policy_of(network: Network) -> CorrectedPolicy:
    assert network.correction is not None
    return CorrectedPolicy(network, network.correction)


def speed_after(policy: object, ticks: int = 480) -> float:
    env = TralCorridorEnv(scenario="straight", randomization="none")
    observation, _ = env.reset(seed=3)
    for _ in range(ticks):
        observation, *_ = env.step(policy.act(observation))  # type: ignore[attr-defined]
    return float(observation[env.unwrapped.world.layout.column("speed")])


def test_the_car_keeps_the_speed_that_the_correction_wants() -> None:
    plain = speed_after(load_policy("doors"))
    assert speed_after(policy_of(constant(0.0, 1.0, bound=0.25))) == pytest.approx(1.25 * plain, rel=0.05)
    assert speed_after(policy_of(constant(0.0, -1.0))) == pytest.approx(0.5 * plain, rel=0.05)


def test_no_correction_changes_nothing() -> None:
    rows = [TralCorridorEnv(scenario="corners").reset(seed=seed)[0] for seed in range(3)]
    corrected, plain = policy_of(constant(0.0, 0.0)), load_policy("doors")
    for observation in rows:
        assert corrected.act(observation).tolist() == plain.act(observation).tolist()
        plain.reset()
        corrected.reset()


def test_the_steering_gets_an_addend_within_its_bound() -> None:
    observation, _ = TralCorridorEnv(scenario="straight").reset(seed=0)
    plain = load_policy("doors").act(observation)
    steered, _ = policy_of(constant(5.0, 0.0)).predict(observation)
    assert steered == pytest.approx([min(plain[0] + 0.2, 1.0), plain[1]], abs=1e-6)


def test_the_environment_of_the_training_drives_as_the_policy_does() -> None:
    rng = np.random.default_rng(0)
    layers = [(rng.normal(0, 0.1, (2, LearnerView(LEARNER, 1).size)).astype(np.float32), np.float32([0.1, 0.6]))]
    network = Network(learner=LEARNER, layers=layers, correction=Correction(machine=DOORS, steering=0.2, speed=0.5))
    envs = TralCorridorVectorEnv(2, scenario="corners", **LEARNER.record())
    envs.correct(load_policy("doors"), 0.2, 0.5)
    env = TralCorridorEnv(scenario="corners")
    features, _ = envs.reset(seed=7)
    readings, _ = env.reset(seed=8)
    policy = policy_of(network)
    for _ in range(40):
        # One row at a time: a product of matrices rounds differently for more rows.
        features, *_ = envs.step(np.concatenate([network.actions(row[None]) for row in features]))
        for _ in range(LEARNER.decision_ticks):
            readings, *_ = env.step(policy.act(readings))
        assert env.unwrapped.world.observation()[0].tolist() == envs.world.observation()[1].tolist()
    envs.close()


@pytest.mark.parametrize("factors", [[1.0], [1.0, -0.1], [1.0, np.nan], [1.0, np.inf]])
def test_factors_that_are_none_are_refused(factors: list[float]) -> None:
    machine = load_policy("doors")
    machine.reset(2)
    with pytest.raises(MachineError, match="expected a number, 0 or more, for each of 2 cars"):
        machine.scale_speeds(np.array(factors))


def test_a_reset_takes_the_factors_back() -> None:
    observation, _ = TralCorridorEnv(scenario="straight").reset(seed=0)
    machine = load_policy("doors")
    machine.act(observation)
    before = machine.speed_target.tolist()
    machine.reset()
    machine.scale_speeds(np.array([1.5]))
    machine.act(observation)
    assert machine.speed_target.tolist() == [1.5 * before[0]]
    machine.reset()
    machine.act(observation)
    assert machine.speed_target.tolist() == before


@pytest.mark.parametrize(("part", "value"), [("steering", 0.0), ("speed", 1.5), ("speed", "fast")])
def test_bounds_that_are_none_are_refused(part: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"correction of the {part} = .*: expected a number above 0, at most 1"):
        Correction(**{"machine": DOORS, "steering": 0.2, "speed": 0.5, part: value})  # type: ignore[arg-type]
    env = TralCorridorVectorEnv(1, scenario="straight")
    with pytest.raises(ConfigError, match=f"correction of the {part} = .*: expected a number above 0, at most 1"):
        env.correct(load_policy("doors"), **{"steering": 0.2, "speed": 0.5, part: value})  # type: ignore[arg-type]
    env.close()


def test_a_file_that_corrects_the_throttle_is_refused(tmp_path: Path) -> None:
    policy_file.save(constant(0.0, 0.0), tmp_path)
    path = tmp_path / "policy.json"
    content = json.loads(path.read_text())
    assert load_policy(tmp_path).machine.definition.name == "doors"
    content["correction"] = {"machine": DOORS, "bounds": [0.2, 0.1]}
    path.write_text(json.dumps(content))
    with pytest.raises(PolicyFileError, match=r"it corrects the throttle, .*: train it again"):
        load_policy(tmp_path)
