"""A car alone drives as it does among others; rows are reset, kept and swept by themselves."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from corridors import commands, corridor
from gymnasium.vector import AutoresetMode

from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT
from tral_env.perception.false_sightings import LIKELY_ID
from tral_env.randomization import LEVELS
from tral_env.vector_env import TralCorridorVectorEnv


@pytest.mark.parametrize("nthread", [1, 2])
def test_a_row_among_others_is_the_single_environment_bit_for_bit(nthread: int) -> None:
    actions = commands(400, 4)
    together = TralCorridorVectorEnv(4, autoreset_mode="SameStep", nthread=nthread, scenario="gates")
    first, _ = together.reset(seed=20)
    row, single = 2, corridor(scenario="gates")
    observation, _ = single.reset(seed=20 + row)
    assert np.array_equal(first[row], observation)
    episodes = 0
    for action in actions:
        many = together.step(action)
        observation, reward, terminated, truncated, _ = single.step(action[row])
        if terminated or truncated:
            assert np.array_equal(many[4]["final_obs"][row], observation)
            observation, _ = single.reset()
            episodes += 1
        assert np.array_equal(many[0][row], observation)
        assert (many[1][row], many[2][row], many[3][row]) == (reward, terminated, truncated)
    assert episodes >= 1


def test_rows_see_the_false_markers_of_the_single_environment() -> None:
    often = LEVELS["default"].fixed(false_sighting_rate=0.3)
    together = TralCorridorVectorEnv(3, scenario="straight", randomization=often)
    single = corridor(scenario="straight", randomization=often)
    first, _ = together.reset(seed=20)
    observation, _ = single.reset(seed=22)
    assert np.array_equal(first[2], observation)
    column, ids = CORE_LAYOUT.column("marker_id"), set()
    for action in commands(80, 3):
        many = together.step(action)[0]
        observation, *_ = single.step(action[2])
        assert np.array_equal(many[2], observation)
        ids |= {*many[:, column].astype(int).tolist()}
    assert LIKELY_ID in ids


def test_next_step_autoreset_equals_gymnasiums_own() -> None:
    native = gym.make_vec("TralCorridor-v0", num_envs=3, scenario="straight")
    rival = gym.make_vec("TralCorridor-v0", num_envs=3, vectorization_mode="sync", scenario="straight")
    assert isinstance(native.unwrapped, TralCorridorVectorEnv)
    a, _ = native.reset(seed=3)
    b, _ = rival.reset(seed=3)
    assert np.array_equal(a, b)
    done = 0
    for action in commands(400, 3):
        one, other = native.step(action), rival.step(action)
        for x, y in zip(one[:4], other[:4], strict=True):
            assert np.array_equal(x, y)
        done += int((one[2] | one[3]).sum())
    assert done >= 1


def test_without_autoreset_rows_are_reset_by_mask() -> None:
    env = TralCorridorVectorEnv(2, autoreset_mode=AutoresetMode.DISABLED, scenario="straight")
    env.reset(seed=0)
    for action in commands(30, 2):
        env.step(action)
    _, info = env.reset(options={"reset_mask": np.array([False, True])})
    assert info["time_s"][0] == pytest.approx(30 / 80)
    assert info["time_s"][1] == 0.0
    with pytest.raises(ConfigError, match="reset_mask"):
        env.reset(options={"reset_mask": [1, 0]})


def test_without_autoreset_a_row_that_ended_rests_until_it_is_reset() -> None:
    env = TralCorridorVectorEnv(2, autoreset_mode="Disabled", scenario="straight", randomization="none")
    env.reset(seed=2)
    ended = False
    while not ended:  # row 0 drives into the wall, row 1 stands
        _, _, terminated, _, info = env.step(np.array([[0.6, 0.6], [0.0, 0.0]]))
        ended = bool(terminated[0])
    pose, time_s = info["pose"].copy(), info["time_s"].copy()
    for _ in range(20):
        _, reward, terminated, _, info = env.step(np.array([[0.6, 0.6], [0.0, 0.5]]))
    assert terminated.tolist() == [True, False]
    assert info["collision"].tolist() == [True, False]
    assert reward[0] == 0.0
    assert np.array_equal(info["pose"][0], pose[0])
    assert info["time_s"].tolist() == pytest.approx([time_s[0], time_s[1] + 20 / 80])
    env.reset(options={"reset_mask": np.array([True, False])})
    _, _, terminated, _, info = env.step(np.zeros((2, 2)))
    assert not terminated[0]
    assert info["time_s"][0] == pytest.approx(1 / 80)


def test_a_mask_that_names_nobody_resets_nobody() -> None:
    env = TralCorridorVectorEnv(2, autoreset_mode="Disabled", scenario="straight")
    env.reset(seed=0)
    env.step(np.zeros((2, 2)))
    _, info = env.reset(options={"reset_mask": np.zeros(2, bool)})
    assert info["time_s"].tolist() == [1 / 80, 1 / 80]


def test_a_parameter_can_be_swept_over_the_rows_and_replayed() -> None:
    env = TralCorridorVectorEnv(3, scenario="straight")
    observation, info = env.reset(seed=1, options={"car": {"friction": [0.5, 0.7, 0.9], "mass_scale": 1.1}})
    assert info["car"]["friction"].tolist() == [0.5, 0.7, 0.9]
    assert info["car"]["mass_scale"].tolist() == [1.1, 1.1, 1.1]
    again, info_again = env.reset(seed=1, options={"car": info["car"]})
    assert np.array_equal(observation, again)
    assert all(np.array_equal(info_again["car"][name], values) for name, values in info["car"].items())
    with pytest.raises(ConfigError, match="expected name -> number or 3 numbers"):
        env.reset(options={"car": {"friction": [0.5, 0.7]}})


def test_a_kept_course_is_the_one_that_its_number_as_seed_gives() -> None:
    env = TralCorridorVectorEnv(20, scenario="crossing", courses=3)
    env.reset(seed=0)
    drawn = corridor(scenario="crossing").unwrapped
    whole = []
    for seed in range(3):
        drawn.reset(seed=seed)
        whole.append(drawn.world.courses[0])
    assert {whole.index(course) for course in env.world.courses} == {0, 1, 2}


def test_a_row_with_kept_courses_drives_as_it_does_alone() -> None:
    env = TralCorridorVectorEnv(4, scenario="obstacles", courses=5)
    alone = corridor(scenario="obstacles", courses=5)
    for _ in range(3):
        rows, _ = env.reset(seed=11)
        one, _ = alone.reset(seed=13)
        assert np.array_equal(rows[2], one)
    rows, _ = env.reset()
    one, _ = alone.reset()
    assert np.array_equal(rows[2], one)


def test_course_k_of_those_that_are_kept_is_that_of_seed_k() -> None:
    env = TralCorridorVectorEnv(6, scenario="obstacles", courses=2, randomization="hard")
    env.reset(seed=0)
    alone = TralCorridorVectorEnv(2, scenario="obstacles", randomization="hard")
    alone.reset(seed=[0, 1])
    assert {one.model_dump_json() for one in env.world.courses} == {
        one.model_dump_json() for one in alone.world.courses
    }


def test_an_array_of_seeds_counts_as_a_list() -> None:
    env = TralCorridorVectorEnv(2, scenario="straight")
    counted, _ = env.reset(seed=5)
    assert np.array_equal(env.reset(seed=np.arange(5, 7))[0], counted)


def test_each_episode_draws_one_of_several_levels_for_its_car_and_its_course() -> None:
    levels = LEVELS["none"].fixed(friction=0.6), replace(LEVELS["hard"], friction=(0.5, 0.5))
    several = TralCorridorVectorEnv(20, scenario="gates", randomization=levels)
    by_level = {}
    for level in levels:
        env = TralCorridorVectorEnv(20, scenario="gates", randomization=level)
        env.reset(seed=3)
        by_level[level.friction[0]] = env.world.courses
    frictions = several.reset(seed=3)[1]["car"]["friction"].tolist()
    assert {*frictions} == {0.5, 0.6}
    assert several.world.courses == [by_level[friction][row] for row, friction in enumerate(frictions)]
    alone = corridor(scenario="gates", randomization=levels)
    assert [alone.reset(seed=3 + row)[1]["car"]["friction"] for row in range(20)] == frictions


def test_kept_courses_are_those_of_the_level_that_was_drawn() -> None:
    env = TralCorridorVectorEnv(20, scenario="gates", courses=2, randomization=("default", "hard"))
    env.reset(seed=0)
    assert {*env.world.kept} == {(0, False), (0, True), (1, False), (1, True)}


def test_the_ranges_of_the_level_hard_bring_its_courses_too() -> None:
    by_name = corridor(scenario="gates", randomization="hard")
    by_range = corridor(scenario="gates", randomization=LEVELS["hard"])
    by_own = corridor(scenario="gates", randomization=replace(LEVELS["hard"], friction=(0.4, 0.6)))
    for seed in range(5):
        for env in (by_name, by_range, by_own):
            env.reset(seed=seed)
        assert by_name.unwrapped.course == by_range.unwrapped.course == by_own.unwrapped.course
