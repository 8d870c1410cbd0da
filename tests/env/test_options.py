"""An option is a field of `CorridorConfig`; the environments take it, name it and refuse what is none."""

import copy
import inspect
import json
import pickle
from dataclasses import fields, replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from corridors import corridor
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from tral_env.config import WIDE_LENS, CameraConfig, CarConfig, TaskConfig
from tral_env.course.generate import SCENARIOS
from tral_env.course.layout import Course, Segment, example_names, example_path
from tral_env.env import TralCorridorEnv, TralCorridorPixelsEnv
from tral_env.errors import ConfigError, UnknownOptionError
from tral_env.options import CorridorConfig, option_fields
from tral_env.perception.degrade import ImageCorruption
from tral_env.randomization import LEVELS
from tral_env.vector_env import TralCorridorVectorEnv

ENVIRONMENTS = (TralCorridorEnv, TralCorridorPixelsEnv, TralCorridorVectorEnv)


@pytest.mark.parametrize("env", ENVIRONMENTS)
def test_an_unknown_option_is_answered_with_the_nearest_and_all_that_are_allowed(env: type) -> None:
    with pytest.raises(UnknownOptionError, match="unknown option 'scenari': did you mean 'scenario'") as refused:
        env(scenari="corners")
    assert str(refused.value).endswith("Allowed: " + ", ".join(inspect.signature(env).parameters))


def test_an_unknown_option_is_an_error_of_the_configuration_and_of_the_call() -> None:
    for kind in (ConfigError, TypeError):
        with pytest.raises(kind, match="did you mean 'view'"):
            gym.make("TralCorridor-v0", veiw="top")
    with pytest.raises(TypeError, match="did you mean 'nthread'"):
        gym.make_vec("TralCorridor-v0", num_envs=2, nthreads=2)


def test_that_the_observation_has_an_image_is_no_option() -> None:
    assert {field.name for field in fields(CorridorConfig)} - {field.name for field in option_fields()} == {
        "image_size"
    }
    with pytest.raises(UnknownOptionError, match="'image_size'"):
        TralCorridorEnv(image_size=(160, 120))


@pytest.mark.parametrize("env", ENVIRONMENTS)
def test_the_signature_names_each_option_with_its_default(env: type) -> None:
    parameters = inspect.signature(env).parameters
    told = {field.name: parameters[field.name].default for field in option_fields()}
    defaults = {field.name: getattr(CorridorConfig(), field.name) for field in option_fields()}
    configurations = {"car", "lens", "task", "image_faults"}
    assert told == {name: None if name in configurations else value for name, value in defaults.items()}


def test_none_and_a_mapping_stand_for_a_configuration() -> None:
    config = TralCorridorEnv(car=None, lens="default", task={"grace_s": 1.0}, groups=["imu"]).world.config
    assert config == CorridorConfig(car=CarConfig(), lens=CameraConfig(), task=TaskConfig(grace_s=1.0), groups=("imu",))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lens": 3}, "option 'lens': got 3: expected a CameraConfig"),
        ({"task": 3}, "option 'task': got 3: expected a TaskConfig"),
        ({"car": {"lock": 1}}, "option 'car': CarConfig has no 'lock'"),
        ({"image_faults": {"nois": 1}}, "option 'image_faults': ImageCorruption has no 'nois': did you mean 'noise'"),
        ({"width": 0}, "width = 0: expected a whole number, 1 or more"),
        ({"height": 4.5}, "height = 4.5: expected a whole number, 1 or more"),
    ],
)
def test_a_wrong_value_is_told_by_the_name_of_its_option(options: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        TralCorridorEnv(**options)


@pytest.mark.parametrize("size", [5, "ab", (0, 10), (160.5, 120), (1, 2, 3)])
def test_an_image_size_that_is_none_is_refused(size: object) -> None:
    with pytest.raises(ConfigError, match=r"image_size = .*: expected width and height"):
        TralCorridorPixelsEnv(image_size=size)


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_have_the_same_options(clone: object) -> None:
    for env in (
        TralCorridorEnv(scenario="gates", groups=("imu",), render_mode="rgb_array", view="top"),
        TralCorridorPixelsEnv(scenario="gates", image_size=(32, 24)),
    ):
        again = clone(env)
        assert again.world.config == env.world.config
        assert (again.render_mode, again.observation_space) == (env.render_mode, env.observation_space)


def test_specs_survive_json() -> None:
    given = {"scenario": "gates", "task": TaskConfig(grace_s=1.0), "groups": ("imu",)}
    again = gym.make(EnvSpec.from_json(corridor(**given).spec.to_json())).unwrapped.world.config
    assert again == CorridorConfig(**given)
    envs = gym.make_vec("TralCorridor-v0", num_envs=2, **given)
    spec = EnvSpec.from_json(envs.spec.to_json())
    assert gym.make_vec(spec, num_envs=2).unwrapped.world.config == CorridorConfig(**given)


OTHERS: dict[str, tuple[object, ...]] = {
    "scenario": ("gates",),
    "course": (
        Course.load(example_path("l_shape")),
        Path(example_path("l_shape")),
        "l_shape",
        {"name": "a", "segments": [{"length": 6}]},
    ),
    "courses": (5, np.int64(5)),
    "anywhere": (0.5,),
    "camera": ("rendered",),
    "randomization": (
        replace(LEVELS["hard"], friction=(0.4, 0.6)),
        LEVELS["none"],
        ("default", LEVELS["hard"]),
        ["none", "hard"],
    ),
    "groups": (("imu",), ["line", "imu"]),
    "car": (CarConfig(full_lock_deg=20.0),),
    "lens": (WIDE_LENS, "wide"),
    "task": (TaskConfig(grace_s=1.0),),
    "image_faults": (ImageCorruption(noise=0.1),),
    "decision_hz": (20.0, np.int64(40)),
    "observation": ("features",),
    "history": (3, np.int64(2)),
    "spacing_s": (0.05,),
    "growth": (1.25,),
    "action": ("speed",),
    "drive_range": ((0.1, 0.4), [0.0, 0.5]),
    "detections": (False,),
    "memory": (True,),
}


@pytest.mark.parametrize(("option", "value"), [(name, value) for name, values in OTHERS.items() for value in values])
def test_a_spec_with_any_option_survives_json(option: str, value: object) -> None:
    given = {"image_faults": {"camera": "rendered"}}.get(option, {}) | {option: value}
    single, several = corridor(**given), gym.make_vec("TralCorridor-v0", num_envs=2, **given)
    config = single.unwrapped.world.config
    assert config != CorridorConfig()
    again = gym.make(EnvSpec.from_json(single.spec.to_json()))
    assert replace(again.unwrapped.world.config, course=None) == replace(config, course=None)
    assert again.unwrapped.world.config.fixed_course() == config.fixed_course()
    both = gym.make_vec(EnvSpec.from_json(several.spec.to_json()), num_envs=2)
    assert both.unwrapped.world.config == again.unwrapped.world.config


def test_each_option_has_another_value_in_that_test() -> None:
    assert set(OTHERS) == {field.name for field in option_fields()}


def test_a_spec_with_a_mode_of_gymnasium_survives_json() -> None:
    envs = gym.make_vec("TralCorridor-v0", num_envs=2, autoreset_mode=AutoresetMode.SAME_STEP)
    again = gym.make_vec(EnvSpec.from_json(envs.spec.to_json()), num_envs=2)
    assert again.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP


def test_a_course_may_be_a_mapping_at_make_and_at_reset() -> None:
    course = Course.load(example_path("l_shape"))
    env = TralCorridorEnv(course=json.loads(course.to_json()))
    env.reset(seed=1)
    assert env.course == course
    env.reset(seed=1, options={"course": {"name": "mine", "segments": [{"length": 6}]}})
    assert env.course == Course(name="mine", segments=(Segment(length=6),))


def test_stable_baselines_takes_the_same_options() -> None:
    make_vec_env = pytest.importorskip("tral_env.sb3", exc_type=ImportError).make_vec_env
    assert make_vec_env(2, scenario="gates").get_attr("world")[0].config == CorridorConfig(scenario="gates")
    with pytest.raises(UnknownOptionError, match="did you mean 'camera'"):
        make_vec_env(2, camra="projected")


def test_the_real_car_too_takes_groups_as_names_in_a_tuple() -> None:
    with pytest.raises(ConfigError, match="groups = 'imu': expected names in a tuple"):
        gym.make("TralCar-v0", groups="imu")


def test_a_course_may_be_given_by_its_name_at_make_and_at_reset() -> None:
    env = gym.make("TralCorridor-v0", course="l_shape")
    env.reset(seed=1)
    assert env.unwrapped.course == Course.load(example_path("l_shape"))
    env.reset(seed=1, options={"course": "one_gate"})
    assert env.unwrapped.course.name == "one_gate"
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    again.reset(seed=1)
    assert again.unwrapped.course.name == "l_shape"
    env.close()
    again.close()


def test_no_course_has_the_name_of_a_family() -> None:
    assert not {*example_names()} & {*SCENARIOS}
