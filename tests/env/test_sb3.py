"""The native vector environment as SB3 wants it."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO

from tral_env.config import TaskConfig
from tral_env.course.generate import generate_plan
from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT
from tral_env.sb3 import SB3CorridorVecEnv, make_vec_env
from tral_env.vector_env import TralCorridorVectorEnv


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
    soon = TaskConfig(nominal_speed=3.0, grace_s=1.0)
    env = make_vec_env(1, seed=0, course="short", task=soon, monitor=False)
    env.reset()
    done, infos = np.zeros(1, bool), [{}]
    while not done[0]:
        _, _, done, infos = env.step(np.zeros((1, 2)))
    assert infos[0]["TimeLimit.truncated"] is True


def test_the_same_seed_gives_the_same_start() -> None:
    starts = [make_vec_env(3, seed=7, scenario="corners").reset() for _ in range(2)]
    assert np.array_equal(*starts)


def test_courses_are_drawn_among_those_that_are_kept() -> None:
    env = make_vec_env(8, seed=0, scenario="crossing", courses=2, monitor=False)
    env.reset()
    world = env.get_attr("world")[0]
    first = {course.model_dump_json() for course in world.courses}
    alone = [generate_plan("crossing", np.random.default_rng(k))[0].model_dump_json() for k in range(2)]
    assert first == set(alone)
    for _ in range(120):  # into the walls, so that some begin anew
        _, _, done, _ = env.step(np.tile([1.0, 1.0], (8, 1)))
        if done.any():
            break
    assert done.any()
    assert {course.model_dump_json() for course in world.courses} <= first


def test_cars_are_told_at_reset_and_can_be_given_one_value_a_row() -> None:
    env = make_vec_env(2, seed=0, scenario="straight")
    env.set_options({"car": {"friction": [0.6, 0.9]}})
    env.reset()
    for told in (env.reset_infos, env.unwrapped.reset_infos):
        assert [info["car"]["friction"] for info in told] == [0.6, 0.9]
    env.reset()
    assert [info["car"]["friction"] for info in env.reset_infos] != [0.6, 0.9]


@pytest.mark.parametrize("monitor", [True, False])
def test_a_row_that_begins_anew_tells_its_new_car(monitor: bool) -> None:
    env = make_vec_env(2, seed=0, scenario="straight", monitor=monitor)
    env.reset()
    before = [info["car"] for info in env.reset_infos]
    command = np.array([[1.0, 0.9], [0.0, 0.0]])  # into the wall, and standing
    done = np.zeros(2, bool)
    while not done.any():
        _, _, done, _ = env.step(command)
    assert done.tolist() == [True, False]
    after = [info["car"] for info in env.reset_infos]
    assert after[0] != before[0]
    assert after[1] == before[1]
    drawn = env.get_attr("world")[0].sim.car_parameters.drawn
    assert after[0] == {name: float(values[0]) for name, values in drawn.items()}


def test_options_for_each_row_are_refused() -> None:
    with pytest.raises(ConfigError, match="expected one mapping"):
        make_vec_env(2, scenario="straight").set_options([{"car": {"friction": 0.6}}, {}])


def test_an_environment_that_resets_otherwise_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"'NextStep': .* expected 'SameStep'"):
        SB3CorridorVecEnv(TralCorridorVectorEnv(2, scenario="straight"))


def test_ppo_learns_on_it_for_a_few_steps() -> None:
    model = PPO("MlpPolicy", make_vec_env(8, seed=0, scenario="straight"), n_steps=32, batch_size=64, n_epochs=1)
    model.learn(512)
    action, _ = model.predict(np.zeros((8, CORE_LAYOUT.size), np.float32), deterministic=True)
    assert action.shape == (8, 2)
