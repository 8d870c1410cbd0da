"""The native vector environment beside Gymnasium's contract and own vector environments, in every autoreset mode."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers.vector import DictInfoToList, NormalizeObservation, RecordEpisodeStatistics
from numpy.testing import assert_array_equal

from tral_env.task import REWARD_TERMS

MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED]
ROWS = 3


def native(mode: AutoresetMode = AutoresetMode.NEXT_STEP, **arguments: Any) -> VectorEnv:
    return gym.make_vec("tral_env:TralCorridor-v0", num_envs=ROWS, autoreset_mode=mode.value, **arguments)


def rival(mode: AutoresetMode, **arguments: Any) -> VectorEnv:
    return SyncVectorEnv([lambda: gym.make("tral_env:TralCorridor-v0", **arguments)] * ROWS, autoreset_mode=mode)


def actions(ticks: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    turns = rng.uniform((-0.2, 0.0, 0.3), (0.4, 0.5, 0.8), (ticks, ROWS))
    return np.stack([turns, rng.uniform(0.3, 0.7, (ticks, ROWS))], axis=2).astype(np.float32)


@pytest.mark.parametrize("mode", MODES)
def test_it_steps_as_gymnasiums_own_vector_environment_does(mode: AutoresetMode) -> None:
    ours, theirs = native(mode, scenario="straight"), rival(mode, scenario="straight")
    one, other = ours.reset(seed=3)[0], theirs.reset(seed=3)[0]
    ended = np.zeros(ROWS, bool)
    episodes = 0
    for action in actions(300):
        assert_array_equal(one, other)
        if mode is AutoresetMode.DISABLED and ended.any():
            one = ours.reset(options={"reset_mask": ended})[0]
            other = theirs.reset(options={"reset_mask": ended.copy()})[0]
            assert_array_equal(one, other)
        one, *ours_end, info = ours.step(action)
        other, *their_end, their_info = theirs.step(action)
        for mine, its in zip(ours_end, their_end, strict=True):
            assert_array_equal(mine, its)
            assert mine.dtype == its.dtype
        ended = ours_end[1] | ours_end[2]
        episodes += ended.sum()
        assert ("is_success" in info) == ("is_success" in their_info)
        if "is_success" in their_info:
            assert_array_equal(info["_is_success"], their_info["_is_success"])
            assert_array_equal(info["is_success"][ended], their_info["is_success"][ended])
        if mode is AutoresetMode.SAME_STEP:
            assert ("final_obs" in info) == ("final_obs" in their_info)
            for row in np.flatnonzero(ended):
                assert_array_equal(info["final_obs"][row], their_info["final_obs"][row])
                for name in ("success", "collision", "progress", "time_s"):
                    assert info["final_info"][name][row] == their_info["final_info"][name][row]
            if ended.any():
                assert_array_equal(info["_final_obs"], their_info["_final_obs"])
    assert episodes >= 3


def test_its_spaces_are_the_single_ones_batched() -> None:
    env = native()
    assert env.num_envs == ROWS
    assert env.observation_space == batch_space(env.single_observation_space, ROWS)
    assert env.action_space == batch_space(env.single_action_space, ROWS)
    observation, _ = env.reset(seed=0)
    assert observation in env.observation_space
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    assert observation in env.observation_space
    assert (reward.shape, terminated.shape, truncated.shape) == ((ROWS,),) * 3
    assert (reward.dtype, terminated.dtype, truncated.dtype) == (np.float64, np.bool_, np.bool_)
    assert isinstance(info, dict)


@pytest.mark.parametrize("mode", MODES)
def test_it_says_how_it_resets(mode: AutoresetMode) -> None:
    assert native(mode).metadata["autoreset_mode"] is mode


def test_seeds_come_as_a_number_or_one_for_each_row() -> None:
    env = native(scenario="corners")
    counted = env.reset(seed=5)[0].copy()
    assert_array_equal(env.reset(seed=[5, 6, 7])[0], counted)
    assert not np.array_equal(env.reset()[0], counted)
    assert_array_equal(env.reset(seed=[None, 6, None])[0][1], counted[1])


def test_rows_do_not_share_memory_with_what_was_handed_out() -> None:
    env = native(scenario="straight")
    first, info = env.reset(seed=0)
    kept, pose = first.copy(), info["pose"].copy()
    env.step(np.tile(np.float32([0.3, 0.5]), (ROWS, 1)))
    assert_array_equal(first, kept)
    assert_array_equal(info["pose"], pose)


def test_every_entry_of_info_has_its_mask() -> None:
    env = native(AutoresetMode.SAME_STEP, scenario="straight")
    infos = [env.reset(seed=0)[1]] + [env.step(action)[4] for action in actions(300)]
    assert any("final_info" in info for info in infos)
    for info in infos:
        for name in info:
            assert name.startswith("_") or info[f"_{name}"].shape == (ROWS,)


@pytest.mark.parametrize("mode", MODES[:2])
def test_a_row_that_begins_anew_tells_its_car_as_gymnasium_tells_it(mode: AutoresetMode) -> None:
    ours, theirs = native(mode, scenario="straight"), rival(mode, scenario="straight")
    for env in (ours, theirs):
        env.reset(seed=3)
    begun = 0
    for action in actions(300):
        info, their = ours.step(action)[4], theirs.step(action)[4]
        assert ("car" in info) == ("car" in their)
        if "car" in their:
            new = their["_car"]
            begun += new.sum()
            assert_array_equal(info["_car"], new)
            for name in info["car"]:
                if not name.startswith("_"):
                    assert_array_equal(info["car"][name][new], their["car"][name][new])
                    assert_array_equal(info["car"][f"_{name}"], new)
    assert begun >= 1


@pytest.mark.parametrize("mode", MODES)
def test_the_terms_of_the_reward_are_told_as_gymnasium_tells_them(mode: AutoresetMode) -> None:
    ours, theirs = native(mode, scenario="straight"), rival(mode, scenario="straight")
    assert "reward_terms" not in ours.reset(seed=3)[1]
    theirs.reset(seed=3)
    ended, finals = np.zeros(ROWS, bool), 0
    for action in actions(300):
        if mode is AutoresetMode.DISABLED and ended.any():
            for env in (ours, theirs):
                env.reset(options={"reset_mask": ended.copy()})
        _, reward, terminated, truncated, info = ours.step(action)
        their = theirs.step(action)[4]
        ended = terminated | truncated
        pairs = [(info, their)] + ([(info["final_info"], their["final_info"])] if "final_info" in info else [])
        finals += len(pairs) - 1
        for one, other in pairs:
            none = np.zeros(ROWS, bool)
            told = other.get("_reward_terms", none)
            assert_array_equal(one["_reward_terms"], told)
            for name in REWARD_TERMS:
                assert_array_equal(one["reward_terms"][f"_{name}"], told)
                assert_array_equal(
                    one["reward_terms"][name][told], other["reward_terms"][name][told] if told.any() else []
                )
        told = info["_reward_terms"]
        assert_array_equal(sum(info["reward_terms"][name] for name in REWARD_TERMS)[told], reward[told])
    assert (finals > 0) == (mode is AutoresetMode.SAME_STEP)


def test_a_row_that_rests_earns_nothing_in_every_term() -> None:
    env = native(AutoresetMode.DISABLED, scenario="straight")
    env.reset(seed=3)
    rested = 0
    ended = np.zeros(ROWS, bool)
    for action in actions(300):
        rests = ended
        _, reward, terminated, truncated, info = env.step(action)
        ended = terminated | truncated
        rested += rests.sum()
        assert not reward[rests].any()
        assert not any(info["reward_terms"][name][rests].any() for name in REWARD_TERMS)
    assert rested


def test_gymnasiums_vector_wrappers_fit() -> None:
    env = DictInfoToList(RecordEpisodeStatistics(NormalizeObservation(native(scenario="straight"))))
    env.reset(seed=0)
    lengths = [row["episode"]["l"] for action in actions(300) for row in env.step(action)[4] if "episode" in row]
    assert lengths
    assert min(lengths) > 20
