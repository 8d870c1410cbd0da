"""The native vector environment as SB3 wants it."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO

from tral_env.interface import CORE_LAYOUT
from tral_env.sb3 import make_vec_env


def test_the_end_of_an_episode_is_told_as_sb3_wants_it() -> None:
    env = make_vec_env(4, seed=0, scenario="straight")
    env.reset()
    ended = None
    for _ in range(400):
        _, reward, done, infos = env.step(np.tile([0.5, 0.7], (4, 1)))
        assert reward.dtype == np.float32
        if done.any():
            ended = infos[int(np.flatnonzero(done)[0])]
            break
    assert ended is not None
    assert ended["is_success"] is False
    assert ended["collision"]
    assert ended["TimeLimit.truncated"] is False
    assert CORE_LAYOUT.space().contains(ended["terminal_observation"])
    assert ended["episode"]["l"] > 10


def test_a_car_that_stands_is_truncated_not_terminated() -> None:
    env = make_vec_env(1, seed=0, scenario="straight", monitor=False)
    env.reset()
    done, infos = np.zeros(1, bool), [{}]
    while not done[0]:
        _, _, done, infos = env.step(np.zeros((1, 2)))
    assert infos[0]["TimeLimit.truncated"] is True


def test_the_same_seed_gives_the_same_start() -> None:
    starts = [make_vec_env(3, seed=7, scenario="corners").reset() for _ in range(2)]
    assert np.array_equal(*starts)


def test_ppo_learns_on_it_for_a_few_steps() -> None:
    model = PPO("MlpPolicy", make_vec_env(8, seed=0, scenario="straight"), n_steps=32, batch_size=64, n_epochs=1)
    model.learn(512)
    action, _ = model.predict(np.zeros((8, CORE_LAYOUT.size), np.float32), deterministic=True)
    assert action.shape == (8, 2)
