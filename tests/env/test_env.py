"""The environment of one car keeps Gymnasium's contract, and ends as it should."""

import copy
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from corridors import corridor
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from tral_env.config import WIDE_LENS, CarConfig, TaskConfig
from tral_env.course.generate import SCENARIOS
from tral_env.interface import CORE_LAYOUT, OPTIONAL_GROUPS, Layout, action_space
from tral_env.randomization import LEVELS, level
from tral_env.task import REWARD_TERMS
from tral_env.vector_env import TralCorridorVectorEnv

ROLL = """
import hashlib, gymnasium as gym, numpy as np, tral_env
env = gym.make("TralCorridor-v0", scenario="gates")
digest = hashlib.sha256(env.reset(seed=5)[0].tobytes())
rng = np.random.default_rng(0)
for _ in range(200):
    observation, *_ = env.step(np.array([rng.uniform(-0.3, 0.3), 0.4], np.float32))
    digest.update(observation.tobytes())
print(digest.hexdigest())
"""


@pytest.mark.parametrize("groups", [(), tuple(OPTIONAL_GROUPS)])
def test_gymnasiums_checker_finds_nothing(groups: tuple[str, ...]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(corridor(scenario="corners", groups=groups).unwrapped, skip_render_check=True)


def test_sb3s_checker_finds_nothing() -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(corridor(scenario="straight").unwrapped, warn=True)


def test_the_spaces_are_those_of_the_interface() -> None:
    env = corridor(scenario="straight")
    assert env.observation_space == CORE_LAYOUT.space()
    assert env.action_space == action_space()


def test_the_real_car_has_the_very_same_spaces() -> None:
    real, simulated = gym.make("TralCar-v0"), corridor(scenario="straight")
    assert real.observation_space == simulated.observation_space
    assert real.action_space == simulated.action_space


def test_the_environment_is_found_without_importing_the_package() -> None:
    code = "import gymnasium; print(gymnasium.make('tral_env:TralCorridor-v0', scenario='straight').spec.id)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "TralCorridor-v0"


def test_its_spec_survives_json() -> None:
    env = corridor(scenario="straight", groups=("imu",))
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.observation_space == env.observation_space


def test_two_processes_see_the_same_bits() -> None:
    runs = [subprocess.run([sys.executable, "-c", ROLL], capture_output=True, text=True, check=True) for _ in range(2)]
    assert runs[0].stdout == runs[1].stdout
    assert len(runs[0].stdout.strip()) == 64


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_random_drives_stay_finite_and_in_bounds(scenario: str) -> None:
    env = TralCorridorVectorEnv(5, scenario=scenario, randomization="hard", groups=tuple(OPTIONAL_GROUPS))
    env.reset(seed=100)
    env.action_space.seed(1)
    for _ in range(600):
        observation, reward, *_ = env.step(env.action_space.sample())
        assert np.isfinite(observation).all()
        assert np.isfinite(reward).all()
        assert (observation >= env.observation_space.low).all()
        assert (observation <= env.observation_space.high).all()
    assert not env.world.sim.physics.batch.warning[..., 1].any()


def test_a_straight_drive_succeeds_and_says_so() -> None:
    env = corridor(scenario="straight", randomization="none")
    observation, _ = env.reset(seed=1, options={"car": {"friction": 0.8}})
    rewards, terminated = [], False
    while not terminated:
        observation, reward, terminated, truncated, info = env.step(steer(observation))
        rewards.append(reward)
        assert not truncated
    assert info["success"]
    assert info["is_success"]
    assert info["progress"] == 1.0
    assert sum(rewards) == pytest.approx(env.unwrapped.plan.length + 5 - 0.005 * len(rewards), abs=0.1)


def steer(observation: np.ndarray) -> np.ndarray:
    """Middle of the corridor, by hand."""
    reading = CORE_LAYOUT.unpack(observation)
    aside = float(np.clip(reading["ultrasonic_left"] - reading["ultrasonic_right"], -0.5, 0.5))
    return np.array([0.3 * aside, 0.4], np.float32)


def test_a_crash_ends_the_episode_and_is_told_from_a_touch() -> None:
    env = corridor(scenario="straight", randomization="none")
    env.reset(seed=2)
    terminated = False
    while not terminated:
        *_, reward, terminated, _, info = env.step(np.array([0.6, 0.6], np.float32))
    assert info["collision"]
    assert info["crash"]
    assert not info["success"]
    assert reward < -1.9


def test_a_car_that_stands_runs_out_of_time() -> None:
    env = corridor(course="short")
    env.reset(seed=0)
    limit = env.unwrapped.plan.length / 0.3 + 10
    ticks, truncated = 0, False
    while not truncated:
        *_, terminated, truncated, info = env.step(np.zeros(2, np.float32))
        ticks += 1
        assert not terminated
    assert ticks / 80 == pytest.approx(limit, abs=1 / 80)
    assert info["is_success"] is False


@pytest.mark.parametrize(("steps", "ends_after"), [(50, 50), (10**6, 1867)])
def test_a_second_limit_of_steps_truncates_once_at_the_earlier_of_both(steps: int, ends_after: int) -> None:
    assert gym.spec("TralCorridor-v0").max_episode_steps is None
    env = gym.make("tral_env:TralCorridor-v0", course="short", max_episode_steps=steps)
    env.reset(seed=0)
    own_limit = 80 * (env.unwrapped.plan.length / 0.3 + 10)
    assert ends_after == min(steps, np.ceil(own_limit))
    ends = [env.step(np.zeros(2, np.float32))[2:4] for _ in range(ends_after)]
    assert ends == [(False, False)] * (ends_after - 1) + [(False, True)]


def test_the_true_clearances_are_what_the_side_ultrasonics_measure() -> None:
    env = corridor(scenario="straight", randomization="none")
    env.reset(seed=4)
    for _ in range(200):
        *_, info = env.step(np.array([0.0, 0.3], np.float32))
    reading = CORE_LAYOUT.unpack(env.unwrapped.world.observation()[0])
    for side in ("left", "right"):
        assert info[f"clearance_{side}_m"] == pytest.approx(reading[f"ultrasonic_{side}"], abs=0.03)


CLEARANCES = {"clearance_left_m", "clearance_right_m"}
TRUTHS = {
    *CLEARANCES, "success", "collision", "crash", "missed_gate", "progress", "gates_passed", "gates_total",
    "lateral_offset_m", "pose", "speed_mps", "time_s",
}  # fmt: skip


def test_the_keys_of_info_are_these_and_the_terms_add_up_to_the_reward_over_a_drive() -> None:
    env = corridor(scenario="gates", randomization="none")
    _, info = env.reset(seed=2)
    assert set(info) | CLEARANCES == TRUTHS | {"car"}
    ended, told = False, set()
    while not ended:
        _, reward, terminated, truncated, info = env.step(np.array([0.1, 0.6], np.float32))
        ended = terminated or truncated
        told.add(frozenset(CLEARANCES & set(info)))
        assert set(info) | CLEARANCES == TRUTHS | {"reward_terms"} | ({"is_success"} if ended else set())
        assert list(info["reward_terms"]) == list(REWARD_TERMS)
        assert all(type(value) is float for value in info["reward_terms"].values())
        assert sum(info["reward_terms"].values()) == reward
    assert info["reward_terms"]["failure"] == -2.0
    assert told == {frozenset(), frozenset(CLEARANCES)}  # both or none


def test_the_drawn_car_can_be_fixed_and_is_told() -> None:
    _, info = corridor(scenario="straight").reset(seed=0, options={"car": {"friction": 0.61}})
    assert info["car"]["friction"] == 0.61
    assert -6 <= info["car"]["mechanism_offset_deg"] <= 6


def test_a_copy_of_an_environment_drives_as_the_first_one_does() -> None:
    first = corridor(scenario="corners", groups=("imu",), randomization="hard")
    again = copy.deepcopy(first)
    assert np.array_equal(first.reset(seed=4)[0], again.reset(seed=4)[0])


def test_a_spec_with_configurations_survives_json() -> None:
    given = {"randomization": LEVELS["hard"], "lens": WIDE_LENS, "task": TaskConfig(grace_s=1.0)}
    again = gym.make(EnvSpec.from_json(corridor(**given).spec.to_json())).unwrapped.world.config
    assert (level(again.randomization), again.lens, again.task) == tuple(given.values())


def test_the_full_lock_of_the_configuration_is_driven() -> None:
    turned = []
    for degrees in (12.0, 22.0):
        env = corridor(scenario="straight", randomization="none", car=CarConfig(full_lock_deg=degrees))
        env.reset(seed=1)
        for _ in range(80):
            *_, info = env.step(np.array([1.0, 0.4], np.float32))
        turned.append(info["pose"][2])
    assert turned[0] < 0.7 * turned[1]


def test_the_inertial_sensor_feels_gravity_from_the_first_reading_on() -> None:
    env = corridor(scenario="straight", randomization="none", groups=("imu",))
    observation, _ = env.reset(seed=1)
    reading = Layout.of(("imu",)).unpack(observation)
    assert reading["imu_accel_z"] == pytest.approx(9.81, abs=1.5)  # five times the bias


def test_a_course_given_at_reset_is_driven(tmp_path: object) -> None:
    from tral_env.course.generate import generate

    course = generate("corners", np.random.default_rng(3))
    env = corridor(scenario="straight")
    _, info = env.reset(seed=0, options={"course": course})
    assert env.unwrapped.course == course
    assert info["gates_total"] == len(env.unwrapped.plan.gate_id)
    env.reset(seed=0)
    assert env.unwrapped.course != course
