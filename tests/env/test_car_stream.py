"""An episode's car and noise do not depend on whether its course is drawn or given."""

import gymnasium as gym
import numpy as np
import pytest
from corridors import commands, corridor

from tral_env.course.layout import Course
from tral_env.world import car_stream

TICKS = 200


def drive(env: gym.Env, seed: int, course: Course | None = None) -> tuple[dict[str, float], np.ndarray]:
    """The car that a seed draws, and what it reads in 200 steps."""
    observation, info = env.reset(seed=seed, options=None if course is None else {"course": course})
    told = [observation]
    for action in commands(TICKS, 1)[:, 0]:
        observation, *_ = env.step(action)
        told.append(observation)
    return info["car"], np.array(told)


def exported(env: gym.Env) -> Course:
    return Course.parse(env.unwrapped.course.to_json())


@pytest.mark.parametrize("family", ["gates", "office"])
def test_a_seed_with_its_exported_course_gives_the_same_drive(family: str) -> None:
    env = corridor(scenario=family, randomization="hard", groups=("imu", "line"))
    car, told = drive(env, 4)
    other = corridor(scenario="straight", randomization="hard", groups=("imu", "line"))
    again, told_again = drive(other, 4, exported(env))
    assert again == car
    np.testing.assert_array_equal(told_again, told)


def test_an_environment_of_that_course_gives_it_too() -> None:
    env = corridor(scenario="gates", randomization="hard")
    car, told = drive(env, 4)
    again, told_again = drive(corridor(course=exported(env), randomization="hard"), 4)
    assert again == car
    np.testing.assert_array_equal(told_again, told)


def test_another_course_of_the_same_seed_has_the_same_car() -> None:
    cars = [corridor(scenario=family).reset(seed=7)[1]["car"] for family in ("straight", "doors")]
    assert cars[0] == cars[1]


def test_each_episode_has_a_stream_of_its_own() -> None:
    episode = np.random.default_rng(1)
    first, second = car_stream(episode).random(), car_stream(episode).random()
    assert first != second
    assert car_stream(np.random.default_rng(1)).random() == first


def test_it_does_not_depend_on_what_was_drawn_before() -> None:
    used = np.random.default_rng(1)
    used.random(1000)
    assert car_stream(used).random() == car_stream(np.random.default_rng(1)).random()
