"""The environments keep Gymnasium's contract, and a car alone drives as it does among others."""

import copy
import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import tral_env.env
from tral_env.config import WIDE_LENS, CarConfig, TaskConfig
from tral_env.course.generate import SCENARIOS
from tral_env.errors import ConfigError, SimulationError
from tral_env.interface import CORE_LAYOUT, Layout, action_space
from tral_env.randomization import LEVELS, level
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


def corridor(**kwargs: object) -> gym.Env:
    return gym.make("TralCorridor-v0", **kwargs)


def commands(ticks: int, n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(-0.2, 0.6, (ticks, n)), rng.uniform(0.3, 0.7, (ticks, n))], axis=2)


@pytest.mark.parametrize("groups", [(), ("line", "imu", "battery")])
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
    env = TralCorridorVectorEnv(10, scenario=scenario, randomization="hard", groups=("imu", "line", "battery"))
    env.reset(seed=100)
    env.action_space.seed(1)
    for _ in range(1000):
        observation, reward, *_ = env.step(env.action_space.sample())
        assert np.isfinite(observation).all()
        assert np.isfinite(reward).all()
        assert (observation >= env.observation_space.low).all()
        assert (observation <= env.observation_space.high).all()
    assert not env.corridor.sim.batch.warning[..., 1].any()


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
    env = corridor(scenario="straight")
    env.reset(seed=0)
    limit = env.unwrapped.plan.length / 0.3 + 10
    ticks, truncated = 0, False
    while not truncated:
        *_, terminated, truncated, info = env.step(np.zeros(2, np.float32))
        ticks += 1
        assert not terminated
    assert ticks / 80 == pytest.approx(limit, abs=1 / 80)
    assert info["is_success"] is False


def test_the_wanted_clearance_makes_an_error_of_clearance() -> None:
    env = corridor(scenario="straight", randomization="none")
    _, info = env.reset(seed=4)
    assert "clearance_error_m" not in info
    for _ in range(200):
        env.unwrapped.want_clearance(1.0, 0.5)
        *_, info = env.step(np.array([0.0, 0.3], np.float32))
    reading = CORE_LAYOUT.unpack(env.unwrapped.corridor.observation()[0])
    assert info["clearance_error_m"] == pytest.approx(reading["ultrasonic_left"] - 0.5, abs=0.03)


def test_the_drawn_car_can_be_fixed_and_is_told() -> None:
    _, info = corridor(scenario="straight").reset(seed=0, options={"car": {"friction": 0.61}})
    assert info["car"]["friction"] == 0.61
    assert -6 <= info["car"]["mechanism_offset_deg"] <= 6


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
        ({"scenario": ["corners"]}, "unknown scenario"),
        ({"groups": "imu"}, r"groups = 'imu': expected names in a tuple"),
        ({"groups": None}, "groups = None: expected names in a tuple"),
        ({"courses": 5, "course": "mine.json"}, "courses = 5 with a course of your own"),
        ({"lens": 3}, "expected a CameraConfig"),
        ({"task": {"nominal_sped": 1}}, "did you mean 'nominal_speed'"),
        ({"car": CarConfig(wheelbase=0.3)}, "wheelbase = 0.3: the car of assets/car.xml has 0.258"),
        ({"view": "chaze"}, "did you mean 'chase'"),
        ({"render_mode": "human"}, "Allowed: None, 'rgb_array'"),
    ],
)
def test_bad_arguments_are_answered_with_the_nearest(arguments: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        tral_env.env.TralCorridorEnv(**arguments)


def test_a_kept_course_is_the_one_that_its_number_as_seed_gives() -> None:
    env = TralCorridorVectorEnv(20, scenario="crossing", courses=3)
    env.reset(seed=0)
    drawn = corridor(scenario="crossing").unwrapped
    whole = []
    for seed in range(3):
        drawn.reset(seed=seed)
        whole.append(drawn.corridor.courses[0])
    assert {whole.index(course) for course in env.corridor.courses} == {0, 1, 2}


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


def test_bad_actions_are_refused() -> None:
    env = corridor(scenario="straight").unwrapped
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="two finite numbers"):
        env.step(np.array([np.nan, 0.0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cours": 1}, "did you mean 'course'"),
        (5, "options = 5"),
        ({"course": 3}, "course = 3"),
        ({"car": 5}, "'car'"),
        ({"car": {"mass_scale": 0.0}}, "mass_scale = .* above 0"),
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


def test_a_mask_that_names_nobody_resets_nobody() -> None:
    env = TralCorridorVectorEnv(2, autoreset_mode="Disabled", scenario="straight")
    env.reset(seed=0)
    env.step(np.zeros((2, 2)))
    _, info = env.reset(options={"reset_mask": np.zeros(2, bool)})
    assert info["time_s"].tolist() == [1 / 80, 1 / 80]


def test_unstable_physics_are_an_error_until_the_next_reset() -> None:
    env = TralCorridorVectorEnv(3, scenario="straight")
    env.reset(seed=0)
    env.corridor.sim.qpos[1, 0] = np.inf
    with pytest.raises(SimulationError, match=r"rows \[1\]"):
        env.step(np.zeros((3, 2)))
    env.reset(seed=0)
    env.step(np.zeros((3, 2)))


def test_a_copy_of_an_environment_drives_as_the_first_one_does() -> None:
    first = corridor(scenario="corners", groups=("imu",), randomization="hard")
    again = copy.deepcopy(first)
    assert np.array_equal(first.reset(seed=4)[0], again.reset(seed=4)[0])


def test_a_spec_with_configurations_survives_json() -> None:
    given = {"randomization": LEVELS["hard"], "lens": WIDE_LENS, "task": TaskConfig(grace_s=1.0)}
    again = gym.make(EnvSpec.from_json(corridor(**given).spec.to_json())).unwrapped.corridor.config
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


@pytest.mark.parametrize("seed", [3.5, "ab", [1, 2.5], [1, "2"]])
def test_seeds_that_are_no_numbers_are_refused(seed: object) -> None:
    with pytest.raises(ConfigError, match=r"seed = .*expected a whole number, or one for each of 2"):
        TralCorridorVectorEnv(2, scenario="straight").reset(seed=seed)


def test_an_array_of_seeds_counts_as_a_list() -> None:
    env = TralCorridorVectorEnv(2, scenario="straight")
    counted, _ = env.reset(seed=5)
    assert np.array_equal(env.reset(seed=np.arange(5, 7))[0], counted)


@pytest.mark.parametrize("car", [0, [], np.ones(2), {3: 1.0}])
def test_parameters_of_a_car_that_are_no_names_and_numbers_are_refused(car: object) -> None:
    with pytest.raises(ConfigError, match=r"options\['car'\] = .*expected name -> number"):
        TralCorridorVectorEnv(2, scenario="straight").reset(seed=0, options={"car": car})


def test_a_reset_that_is_refused_leaves_the_cars_where_they_are() -> None:
    env, other = (TralCorridorVectorEnv(2, scenario="straight") for _ in range(2))
    for one in (env, other):
        one.reset(seed=0)
    with pytest.raises(ConfigError, match=r"latency_s = \(0.5, 0.5\): expected at most 0.2 s"):
        env.reset(options={"car": {"latency_s": 0.5}})
    with pytest.raises(ConfigError, match=r"image_degradation = \(11.0, 11.0\): expected at most 10"):
        env.reset(options={"car": {"image_degradation": 11.0}})
    with pytest.raises(ConfigError, match="expected name -> number or 2 numbers"):
        env.reset(options={"car": {"friction": 10**400}})
    forward = np.tile([0.1, 0.5], (2, 1))
    assert np.array_equal(env.step(forward)[0], other.step(forward)[0])


def test_course_k_of_those_that_are_kept_is_that_of_seed_k() -> None:
    env = TralCorridorVectorEnv(6, scenario="obstacles", courses=2, randomization="hard")
    env.reset(seed=0)
    alone = TralCorridorVectorEnv(2, scenario="obstacles", randomization="hard")
    alone.reset(seed=[0, 1])
    assert {one.model_dump_json() for one in env.corridor.courses} == {
        one.model_dump_json() for one in alone.corridor.courses
    }


@pytest.mark.parametrize("name", ["num_envs", "nthread"])
def test_true_is_no_number_of_anything(name: str) -> None:
    with pytest.raises(ConfigError, match=f"{name} = True: expected a whole number, 1 or more"):
        TralCorridorVectorEnv(**{"scenario": "straight", name: True})
