"""Decisions that are held for several ticks, and observations made for learners, in every environment."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from tral_env.env import TralCorridorEnv, TralCorridorPixelsEnv
from tral_env.errors import ConfigError
from tral_env.learner import LearnerConfig, LearnerView
from tral_env.vector_env import TralCorridorVectorEnv

LEARNER: dict[str, Any] = {"decision_hz": 10, "history": 3, "observation": "features", "action": "speed"}
ROWS = 3
MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED]


def actions(decisions: int, rows: int = ROWS, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform((-0.3, 0.0), (0.6, 1.0), (decisions, rows, 2)).astype(np.float32)


@settings(max_examples=4)
@given(seed=st.integers(0, 10_000), hz=st.sampled_from([40, 16, 10]))
def test_a_decision_is_its_command_held_for_so_many_plain_steps(seed: int, hz: int) -> None:
    held, plain = TralCorridorEnv(scenario="corners", decision_hz=hz), TralCorridorEnv(scenario="corners")
    assert_array_equal(held.reset(seed=seed)[0], plain.reset(seed=seed)[0])
    for (action,) in actions(60, 1, seed):
        one, reward, terminated, truncated, info = held.step(action)
        earned: list[float] = []
        for _ in range(80 // hz):
            other, each, *end, told = plain.step(action)
            earned.append(each)
            if any(end):
                break
        assert_array_equal(one, other)
        assert [terminated, truncated] == end
        assert reward == pytest.approx(sum(earned), abs=1e-9)
        assert reward == sum(info["reward_terms"].values())
        for name in ("time_s", "progress", "collision", "success", "missed_gate", "speed_mps"):
            assert info[name] == told[name]
        if terminated or truncated:
            assert info["is_success"] is told["is_success"]
            break


def test_features_are_those_of_the_view_over_the_readings() -> None:
    options = {"scenario": "crossing"}
    env, plain = TralCorridorEnv(**options, **LEARNER | {"action": "throttle"}), TralCorridorEnv(**options)
    config = LearnerConfig(**LEARNER | {"action": "throttle"})
    view = LearnerView(config, 1)
    seen, _ = env.reset(seed=4)
    readings, _ = plain.reset(seed=4)
    view.reset(np.array([True]), readings[None])
    for (action,) in actions(12, 1):
        assert_array_equal(seen, view.observation()[0])
        seen, *_ = env.step(action)
        for _ in range(config.decision_ticks):
            view.update(plain.step(action)[0][None])


@pytest.mark.parametrize("nthread", [1, 2])
def test_a_row_among_eight_is_the_single_environment(nthread: int) -> None:
    together = TralCorridorVectorEnv(8, "SameStep", nthread, scenario="gates", **LEARNER)
    single = TralCorridorEnv(scenario="gates", **LEARNER)
    row, ends = 5, 0
    many, one = together.reset(seed=20)[0], single.reset(seed=20 + row)[0]
    for action in actions(60, 8):
        assert_array_equal(many[row], one)
        many, reward, terminated, truncated, info = together.step(action)
        one, *told, _ = single.step(action[row])
        assert [reward[row], terminated[row], truncated[row]] == told
        if any(told[1:]):
            assert_array_equal(info["final_obs"][row], one)
            one, _ = single.reset()
            ends += 1
    assert ends


@pytest.mark.parametrize("mode", MODES)
def test_in_every_autoreset_mode_it_steps_as_gymnasiums_own_vector_environment_does(mode: AutoresetMode) -> None:
    name = "tral_env:TralCorridor-v0"
    options = {"scenario": "straight", **LEARNER}
    ours = gym.make_vec(name, num_envs=ROWS, autoreset_mode=mode.value, **options)
    theirs = SyncVectorEnv([lambda: gym.make(name, **options)] * ROWS, autoreset_mode=mode)
    assert ours.single_observation_space == theirs.single_observation_space
    one, other = ours.reset(seed=3)[0], theirs.reset(seed=3)[0]
    ended, episodes = np.zeros(ROWS, bool), 0
    for action in actions(60):
        assert_array_equal(one, other)
        if mode is AutoresetMode.DISABLED and ended.any():
            one = ours.reset(options={"reset_mask": ended})[0]
            other = theirs.reset(options={"reset_mask": ended.copy()})[0]
            assert_array_equal(one, other)
        one, *end, info = ours.step(action)
        other, *their_end, their_info = theirs.step(action)
        for mine, its in zip(end, their_end, strict=True):
            assert_array_equal(mine, its)
        ended = end[1] | end[2]
        episodes += ended.sum()
        if mode is AutoresetMode.SAME_STEP and ended.any():
            for row in np.flatnonzero(ended):
                assert_array_equal(info["final_obs"][row], their_info["final_obs"][row])
                for key in ("time_s", "progress"):
                    assert info["final_info"][key][row] == their_info["final_info"][key][row]
    assert episodes >= 2


def test_a_row_that_ended_is_not_driven_on_within_the_decision() -> None:
    env = TralCorridorVectorEnv(2, "Disabled", scenario="straight", randomization="none", decision_hz=1)
    env.reset(seed=2)
    terminated = np.zeros(2, bool)
    while not terminated.any():
        _, _, terminated, _, info = env.step(np.array([[0.6, 0.6], [0.0, 0.0]]))
    at, whole = info["time_s"]
    assert terminated.tolist() == [True, False]
    assert at < whole
    assert whole == pytest.approx(round(whole))
    assert info["collision"].tolist() == [True, False]
    *_, info = env.step(np.array([[0.6, 0.6], [0.0, 0.0]]))
    assert info["time_s"].tolist() == pytest.approx([at, whole + 1.0])


def test_an_episode_that_ends_within_a_decision_stops_earning() -> None:
    env = TralCorridorEnv(scenario="straight", randomization="none", decision_hz=1, task={"time_cost": 1.0})
    env.reset(seed=2)
    before, terminated = 0.0, False
    while not terminated:
        _, _, terminated, _, info = env.step(np.array([0.6, 0.6]))
        ticks = round((info["time_s"] - before) * 80)
        assert info["reward_terms"]["time"] == -ticks
        before = info["time_s"]
    assert ticks < 80


@pytest.mark.parametrize(
    "options", [LEARNER, {"history": 4, "spacing_s": 0.05}, {"decision_hz": 20, "groups": ("imu",)}]
)
def test_gymnasiums_checker_finds_nothing(options: dict) -> None:
    env = TralCorridorEnv(scenario="corners", **options)
    check_env(env, skip_render_check=True, skip_close_check=True)
    assert env.metadata["render_fps"] == options.get("decision_hz", 80)


def test_a_standing_learner_drives_at_the_speed_that_it_asks_for() -> None:
    env = TralCorridorEnv(
        scenario="straight", randomization="none", decision_hz=10, action="speed", drive_range=(0.0, 1.0)
    )
    env.reset(seed=0)
    for _ in range(30):
        *_, info = env.step(np.array([0.0, 0.0]))
    assert info["speed_mps"] == pytest.approx(0.5, abs=0.05)


def test_features_are_of_the_core_readings_alone() -> None:
    with pytest.raises(ConfigError, match=r"groups = \('imu',\) with observation='features'"):
        TralCorridorEnv(observation="features", groups=("imu",))


@pytest.mark.parametrize("options", [{"observation": "features"}, {"history": 2}])
def test_images_have_neither_features_nor_history(options: dict) -> None:
    with pytest.raises(ConfigError, match="with images, which have neither features nor history"):
        TralCorridorPixelsEnv(**options)


def test_pixels_take_decisions_and_speeds() -> None:
    env = TralCorridorPixelsEnv(image_size=(16, 12), decision_hz=10, action="speed")
    assert env.world.config.decision_ticks == 8


def test_an_episode_draws_one_of_several_families() -> None:
    env = TralCorridorVectorEnv(12, scenario=("straight", "crossing"))
    env.reset(seed=0)
    straight = [len(plan.straights) == 1 for plan in env.world.plans if plan is not None]
    assert 0 < sum(straight) < 12
    single = TralCorridorEnv(scenario=["straight", "crossing"])
    single.reset(seed=7)
    assert single.course == env.world.courses[7]


def test_stable_baselines_takes_them_too() -> None:
    make_vec_env = pytest.importorskip("tral_env.sb3", exc_type=ImportError).make_vec_env
    env = make_vec_env(4, seed=0, scenario="straight", **LEARNER)
    assert env.reset().shape == (4, LearnerView(LearnerConfig(**LEARNER), 1).size)
    done = np.zeros(4, bool)
    while not done.any():
        _, _, done, infos = env.step(np.tile([0.6, 1.0], (4, 1)))
    row = int(np.flatnonzero(done)[0])
    assert env.observation_space.contains(infos[row]["terminal_observation"])
