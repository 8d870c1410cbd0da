"""What an environment cannot do it refuses by name, and stays as it was."""

import re

import gymnasium as gym
import numpy as np
import pytest
from corridors import corridor

import tral_env.env
from tral_env.config import CarConfig
from tral_env.course.layout import Course, Door, Segment
from tral_env.env import TralCorridorEnv
from tral_env.errors import ConfigError, SimulationError, TralError
from tral_env.vector_env import TralCorridorVectorEnv


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scenario": "corner"}, "did you mean 'corners'"),
        ({"camera": "render"}, "did you mean 'rendered'"),
        ({"randomization": "hrd"}, "did you mean 'hard'"),
        ({"groups": ("imus",)}, "did you mean 'imu'"),
        ({"groups": ("imu", "imu")}, "'imu' is given twice"),
        ({"course": 3}, "course = 3"),
        ({"courses": 0}, "courses = 0: expected a whole number, 1 or more"),
        ({"courses": True}, "courses = True: expected a whole number"),
        ({"courses": 2**70}, "expected a whole number"),
        ({"scenario": ["corners", "corner"]}, "did you mean 'corners'"),
        ({"camera": ["rendered"]}, "unknown camera"),
        ({"randomization": ["default", "hrd"]}, "did you mean 'hard'"),
        ({"randomization": ()}, r"randomization = \(\): expected one or more levels"),
        ({"view": ["chase"]}, r"unknown view \['chase'\]: did you mean 'chase'"),
        ({"view": np.array(["chase"])}, "unknown view"),
        ({"course": {"name": "no segments"}}, "segments: missing"),
        ({"course": {"segments": {1, 2}}}, "option 'course': got .*: expected what a course file could hold"),
        ({"groups": "imu"}, r"groups = 'imu': expected names in a tuple"),
        ({"groups": None}, "groups = None: expected names in a tuple"),
        ({"courses": 5, "course": "mine.json"}, "courses = 5 with a course of your own"),
        ({"lens": 3}, "expected a CameraConfig"),
        ({"task": {"nominal_sped": 1}}, "did you mean 'nominal_speed'"),
        ({"car": CarConfig(wheelbase=0.3)}, "wheelbase = 0.3: the car of assets/car.xml has 0.258"),
        ({"view": "chaze"}, "did you mean 'chase'"),
        ({"render_mode": "ansi"}, "Allowed: None, 'human', 'rgb_array'"),
    ],
)
def test_bad_arguments_are_answered_with_the_nearest(arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message) as refused:
        tral_env.env.TralCorridorEnv(**arguments)
    assert isinstance(refused.value, TralError)


NO_ACTIONS = (["a", "b"], ["0.1", "0.5"], [True, False], None, [[0.1], [0.1, 0.5]], [0.1, 10**400])


@pytest.mark.parametrize("action", [np.array([np.nan, 0.0]), [0.1, 0.2, 0.3], *NO_ACTIONS])
def test_bad_actions_are_refused(action: object) -> None:
    env = corridor(scenario="straight").unwrapped
    env.reset(seed=0)
    with pytest.raises(ConfigError, match=r"action .*: expected two finite numbers: steering, throttle"):
        env.step(action)


@pytest.mark.parametrize("actions", [np.zeros((3, 2)), np.full((2, 2), np.inf), *NO_ACTIONS])
def test_bad_actions_of_several_cars_are_refused(actions: object) -> None:
    env = TralCorridorVectorEnv(2, scenario="straight")
    env.reset(seed=0)
    with pytest.raises(ConfigError, match=r"actions of .*: expected \(2, 2\) finite numbers"):
        env.step(actions)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cours": 1}, "did you mean 'course'"),
        (5, "options = 5"),
        ([], r"options = \[\]"),
        ({"course": 3}, "course = 3"),
        ({"car": 5}, "'car'"),
        ({"car": {"_fricton": 1.0}}, "unknown parameter '_fricton': did you mean 'friction'"),
        ({"car": {"mass_scale": 0.0}}, "mass_scale = .* above 0"),
        ({"car": {"friction": "0.5"}}, r"options\['car'\], friction = '0.5': expected a finite number"),
        ({"car": {"friction": True}}, "friction = True: expected a finite number"),
        ({"car": {"friction": np.array([True])}}, "friction = True: expected a finite number"),
        ({"car": {"friction": [0.5, 0.6]}}, "expected name -> number or 1 numbers"),
        ({"car": {"hard_courses": True}}, "expected a finite number"),
        ({"car": {"hard_courses": 1.0}}, "unknown parameter 'hard_courses'"),
        ({"car": {"camera_latency_s": -1.0}}, "camera_latency_s = .* from 0"),
        ({"car": {"hall_miss_rate": 7.0}}, "hall_miss_rate = .* between 0 and 1"),
    ],
)
def test_bad_options_are_refused(options: object, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        corridor(scenario="straight").unwrapped.reset(seed=0, options=options)


def test_a_car_does_not_drive_before_its_first_reset() -> None:
    env = TralCorridorVectorEnv(2, autoreset_mode="Disabled", scenario="straight")
    with pytest.raises(ConfigError, match="before the first reset"):
        env.step(np.zeros((2, 2)))
    with pytest.raises(ConfigError, match="1 of 2 cars"):
        env.reset(seed=0, options={"reset_mask": np.array([True, False])})


def test_unstable_physics_are_an_error_until_the_next_reset() -> None:
    env = TralCorridorVectorEnv(3, scenario="straight")
    env.reset(seed=0)
    env.world.sim.physics.qpos[1, 0] = np.inf
    with pytest.raises(SimulationError, match=r"rows \[1\]"):
        env.step(np.zeros((3, 2)))
    env.reset(seed=0)
    env.step(np.zeros((3, 2)))


@pytest.mark.parametrize("seed", [-1, 1.5, True, "1", [1]])
def test_a_seed_that_is_none_is_refused(seed: object) -> None:
    with pytest.raises(ConfigError, match=r"seed = .*: expected a whole number, 0 or more, or None"):
        TralCorridorEnv(scenario="straight").reset(seed=seed)


def test_a_seed_may_be_a_number_of_numpy() -> None:
    env = TralCorridorEnv(scenario="straight")
    assert np.array_equal(env.reset(seed=np.int64(3))[0], env.reset(seed=3)[0])


@pytest.mark.parametrize("seed", [3.5, "ab", -1, True, [1, 2.5], [1, "2"], [1, -1], [True, 1]])
def test_seeds_that_are_no_numbers_are_refused(seed: object) -> None:
    with pytest.raises(ConfigError, match=r"seed = .*expected a whole number, or one for each of 2"):
        TralCorridorVectorEnv(2, scenario="straight").reset(seed=seed)


@pytest.mark.parametrize("car", [0, [], np.ones(2), {3: 1.0}])
def test_parameters_of_a_car_that_are_no_names_and_numbers_are_refused(car: object) -> None:
    with pytest.raises(ConfigError, match=r"options\['car'\] = .*expected name -> number"):
        TralCorridorVectorEnv(2, scenario="straight").reset(seed=0, options={"car": car})


def test_a_reset_that_is_refused_leaves_the_cars_where_they_are() -> None:
    env, other = (TralCorridorVectorEnv(2, scenario="straight") for _ in range(2))
    for one in (env, other):
        one.reset(seed=0)
    with pytest.raises(ConfigError, match=r"latency_s = 0\.5 s: expected 0 to 0\.2 s"):
        env.reset(options={"car": {"latency_s": 0.5}})
    with pytest.raises(ConfigError, match=r"image_degradation = 11: expected 0 to 10"):
        env.reset(options={"car": {"image_degradation": 11.0}})
    with pytest.raises(ConfigError, match=r"friction = 10.*: expected a finite number"):
        env.reset(options={"car": {"friction": 10**400}})
    forward = np.tile([0.1, 0.5], (2, 1))
    assert np.array_equal(env.step(forward)[0], other.step(forward)[0])


DOORS = tuple(Door(side=side, at=1.6 + 1.15 * i) for i in range(11) for side in ("left", "right"))
TOO_BIG = {"course": Course(name="big", segments=(Segment(length=16.0, width=2.0, doors=DOORS),))}


@pytest.mark.parametrize("options", [{"cours": 1}, {"car": {"latency_s": 0.5}}, {"course": "nope.json"}])
def test_a_reset_that_is_refused_does_not_seed(options: dict) -> None:
    env, other = (TralCorridorEnv(scenario="corners") for _ in range(2))
    vector, rival = (TralCorridorVectorEnv(2, "Disabled", scenario="corners") for _ in range(2))
    for one in (env, other, vector, rival):
        one.reset(seed=0)
    for one in (env, vector):
        with pytest.raises(ConfigError):
            one.reset(seed=1, options=options)
        with pytest.raises(ConfigError):
            one.reset(options=options)
    assert env.np_random_seed == 0
    assert np.array_equal(env.reset()[0], other.reset()[0])
    assert np.array_equal(vector.reset()[0], rival.reset()[0])


def test_a_course_that_does_not_fit_and_a_wrong_seed_do_not_seed_either() -> None:
    env, other = (TralCorridorVectorEnv(2, "Disabled", scenario="straight") for _ in range(2))
    for one in (env, other):
        one.reset(seed=0)
    with pytest.raises(ConfigError, match="this course needs"):
        env.reset(seed=1, options={"reset_mask": np.array([True, False]), **TOO_BIG})
    for options in ({}, TOO_BIG):
        with pytest.raises(ConfigError, match=r"seed = \[1, -1\]"):
            env.reset(seed=[1, -1], options=options)
    forward = np.tile([0.1, 0.5], (2, 1))
    assert np.array_equal(env.step(forward)[0], other.step(forward)[0])
    assert np.array_equal(env.reset()[0], other.reset()[0])


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_mask_is_refused_where_rows_reset_by_themselves(mode: str) -> None:
    env = TralCorridorVectorEnv(2, mode, scenario="straight")
    env.reset(seed=0)
    with pytest.raises(
        ConfigError, match=f"reset_mask with autoreset_mode='{mode}'.*expected autoreset_mode='Disabled'"
    ):
        env.reset(options={"reset_mask": np.array([True, False])})


@pytest.mark.parametrize("name", ["num_envs", "nthread"])
def test_true_is_no_number_of_anything(name: str) -> None:
    with pytest.raises(ConfigError, match=f"{name} = True: expected a whole number, 1 or more"):
        TralCorridorVectorEnv(**{"scenario": "straight", name: True})


@pytest.mark.parametrize(
    ("course", "told"),
    [
        ("nope.json", "Expected a Course, the path of its file, or its name: "),
        (".", "Expected a Course, the path of its file, or its name: "),
        ("l_shap", "did you mean 'l_shape'?"),
        ("./short", "Expected a Course, the path of its file, or its name: "),
        ("office", "It is a family: scenario='office'"),
    ],
)
def test_a_course_file_that_cannot_be_opened_is_refused_at_make(course: str, told: str):
    with pytest.raises(ConfigError, match=re.escape(f"course = {course!r}: cannot be read: ") + ".*" + re.escape(told)):
        gym.make("tral_env:TralCorridor-v0", course=course)
