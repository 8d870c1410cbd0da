"""The real car behind Gymnasium's interface, on fake devices and a fake clock."""

import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from fakes import Clock, FakeSmbus, Pca9685Fake, Srf08Fake
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from tral_env.errors import CalibrationError, ConfigError, HardwareError
from tral_env.hardware.actuator.settings import Limits
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.env import TralCarEnv
from tral_env.hardware.pulses import pulses
from tral_env.hardware.sensors import HallCounter, SensorGroup
from tral_env.hardware.sonar import SonarArray
from tral_env.interface import CORE_LAYOUT, action_space, check_readings

TT01 = load_calibration("tt01")
NEUTRAL = (1530.0, 1530.0)
PERIOD_S = 0.0125
GO = np.array([0.5, 0.25], np.float32)


def car(**options):
    clock = Clock()
    env = TralCarEnv(clock=clock, sleep=clock.sleep, **options)
    return env, clock


def sent(env):
    return [(pulse.steering_us, pulse.throttle_us) for pulse in env.output.sent]


class Broken:
    """Sensors that work for some reads and then fail."""

    def __init__(self, good, error):
        self.good, self.error, self.stopped = good, error, False

    def start(self):
        pass

    def read(self, now):
        self.good -= 1
        if self.good < 0:
            raise self.error
        return {}

    def stop(self):
        self.stopped = True


class Fixed(Broken):
    """Sensors that always say the same."""

    def __init__(self, **readings):
        super().__init__(0, OSError())
        self.readings = readings

    def read(self, now):
        return self.readings


def test_spaces_are_those_of_the_simulated_car():
    env, _ = car()
    assert env.observation_space == CORE_LAYOUT.space()
    assert env.action_space == action_space()


def test_gymnasium_finds_nothing_to_complain_about():
    clock = Clock()
    env = gym.make("TralCar-v0", clock=clock, sleep=clock.sleep)
    check_env(env.unwrapped)
    env.close()


def test_a_specification_of_plain_options_survives_json():
    env = gym.make("tral_env:TralCar-v0", calibration="tt01", output="recorder", max_duration_s=5.0)
    again = gym.make(gym.spec("TralCar-v0").from_json(env.spec.to_json()))
    assert again.spec.kwargs == env.spec.kwargs
    env.close()
    again.close()


def test_a_fresh_car_has_seen_nothing():
    env, _ = car()
    observation, info = env.reset(seed=1)
    assert (observation == CORE_LAYOUT.missing(1)[0].astype(np.float32)).all()
    assert info == {"tick": 0, "late_ticks": 0, "steering_us": 1530.0, "throttle_us": 1530.0}


def test_neutral_is_sent_first_and_last():
    env, _ = car()
    assert sent(env) == [NEUTRAL]
    env.reset()
    assert sent(env) == [NEUTRAL] * 2
    env.step(GO)
    env.close()
    env.close()
    assert sent(env)[2] == tuple(pulses(GO, TT01).tolist()) == (1385.0, 1432.5)
    assert sent(env)[3:] == [NEUTRAL]


def test_neutral_that_failed_at_the_close_is_sent_by_the_next_one():
    class Stubborn:
        def __init__(self):
            self.sent, self.failures = [], 0

        def write(self, steering_us, throttle_us):
            self.sent.append((steering_us, throttle_us))

        def close(self):
            if self.failures:
                self.failures -= 1
                raise HardwareError("no answer")
            self.write(*NEUTRAL)

    output = Stubborn()
    env, _ = car(output=output)
    env.reset()
    env.step(GO)
    output.failures = 1
    with pytest.raises(HardwareError):
        env.close()
    with pytest.raises(ResetNeeded):
        env.step(GO)
    env.close()
    assert output.sent[-1] == NEUTRAL


def test_a_bus_that_fails_at_a_reset_is_an_error_of_the_hardware():
    class Unplugged:
        def write(self, steering_us, throttle_us):
            raise OSError(121, "Remote I/O error")

        def close(self):
            pass

    env, _ = car(output=Unplugged())
    with pytest.raises(HardwareError, match="Remote I/O error"):
        env.reset()


def test_devices_that_cannot_be_copied_leave_a_specification():
    clock = Clock()
    env = gym.make("TralCar-v0", sensors=SensorGroup(HallCounter(clock=clock)), clock=clock, sleep=clock.sleep)
    assert isinstance(env.spec.kwargs["sensors"], SensorGroup)
    env.close()


def test_the_observation_has_the_command_as_applied():
    env, _ = car()
    env.reset()
    observation, reward, terminated, truncated, info = env.step(np.array([0.5, 3.0]))
    values = CORE_LAYOUT.unpack(observation)
    assert (values["steering"], values["throttle"]) == (0.5, 1.0)
    assert (reward, terminated, truncated) == (0.0, False, False)
    assert (info["steering_us"], info["throttle_us"]) == (1385.0, 1140.0)


def test_the_slew_limit_shows_in_the_observation():
    slow = TT01.model_copy(update={"steering": TT01.steering.model_copy(update={"slew_per_s": 8.0})})
    env, _ = car(calibration=slow)
    env.reset()
    steering = [CORE_LAYOUT.unpack(env.step(np.array([1.0, 0.0]))[0])["steering"] for _ in range(3)]
    assert steering == pytest.approx([0.1, 0.2, 0.3])


def test_readings_land_in_their_columns():
    env, _ = car(sensors=Fixed(ultrasonic_left=0.75, ultrasonic_left_age=0.0625, distance=12.5, speed=0.5))
    observation, _ = env.reset()
    values = CORE_LAYOUT.unpack(observation)
    assert (values["ultrasonic_left"], values["ultrasonic_left_age"]) == (0.75, 0.0625)
    assert (values["distance"], values["speed"]) == (12.5, 0.5)
    assert (values["ultrasonic_front"], values["gate_id"]) == (6.0, -1.0)


def test_steps_are_an_eightieth_of_a_second_apart():
    env, _ = car()
    env.reset()
    for _ in range(81):
        _, _, _, _, info = env.step(GO)
    times = np.array([pulse.time_s for pulse in env.output.sent[2:]])
    assert np.diff(times) == pytest.approx(PERIOD_S)
    assert info["late_ticks"] == 0


def test_time_that_the_policy_takes_is_part_of_the_period():
    env, clock = car()
    env.reset()
    for _ in range(5):
        clock.now += 0.005
        env.step(GO)
    times = np.array([pulse.time_s for pulse in env.output.sent[3:]])
    assert np.diff(times) == pytest.approx(PERIOD_S)


def test_a_late_tick_is_counted_and_never_made_up_for():
    env, clock = car()
    env.reset()
    env.step(GO)
    for late in (0.0, 0.1, 0.0, 0.0, 0.03, 0.0):
        clock.now += late
        info = env.step(GO)[-1]
    times = np.array([pulse.time_s for pulse in env.output.sent[2:]])
    # A late command goes out at once; the one after it keeps its distance.
    assert info["late_ticks"] == 2
    assert np.diff(times).tolist() == pytest.approx([0.0125, 0.1125, 0.0125, 0.0125, 0.0425, 0.0125])


@pytest.mark.parametrize("bad", [[np.nan, 0], [0, np.inf], [0, 0, 0], [[0, 0]], 0.0])
def test_what_is_no_command_is_never_sent_and_neutral_is(bad):
    env, _ = car()
    env.reset()
    env.step(GO)
    with pytest.raises(ConfigError, match="steering, throttle"):
        env.step(np.array(bad))
    assert sent(env)[3:] == [NEUTRAL]


def test_the_end_of_an_episode_is_in_neutral():
    env, _ = car(max_duration_s=0.1)
    env.reset()
    steps = 1
    while not env.step(GO)[3]:
        steps += 1
    assert steps == 8
    assert sent(env)[-1] == NEUTRAL
    with pytest.raises(ResetNeeded):
        env.step(GO)
    env.reset()
    assert env.step(GO)[4]["tick"] == 1


def test_a_step_without_reset_is_refused():
    env, _ = car()
    with pytest.raises(ResetNeeded, match="reset"):
        env.step(GO)


@pytest.mark.parametrize("error", [HardwareError("sonar"), OSError(121, "Remote I/O error")])
def test_a_sensor_that_fails_ends_in_neutral_and_a_hardware_error(error):
    env, _ = car(sensors=Broken(2, error))
    env.reset()
    env.step(GO)
    with pytest.raises(HardwareError):
        env.step(GO)
    assert sent(env)[-1] == NEUTRAL
    with pytest.raises(ResetNeeded):
        env.step(GO)


def test_an_interrupt_ends_in_neutral():
    env, _ = car(sensors=Broken(1, KeyboardInterrupt()))
    env.reset()
    with pytest.raises(KeyboardInterrupt):
        env.step(GO)
    assert sent(env)[-1] == NEUTRAL


def test_nonsense_from_a_sensor_is_not_passed_on():
    env, _ = car(sensors=Fixed(speed=float("nan")))
    with pytest.raises(HardwareError, match="speed = nan"):
        env.reset()
    assert sent(env)[-1] == NEUTRAL


def test_a_reading_that_does_not_exist_is_refused():
    env, _ = car(sensors=Fixed(sped=1.0))
    with pytest.raises(ConfigError, match="did you mean 'speed'"):
        env.reset()


def metal(left=0.8):
    """The whole car on one fake bus."""
    clock = Clock()
    chip = Pca9685Fake()
    devices = {0x40: chip} | {0x70 + i: Srf08Fake(clock, metres) for i, metres in enumerate((left, 3.0, 1.2))}
    bus = FakeSmbus(devices)
    env = gym.make(
        "TralCar-v0", output="pca9685", sensors="srf08", bus=bus, calibration=MEASURED, clock=clock, sleep=clock.sleep
    )
    return env, bus, chip, clock


MEASURED = TT01.model_copy(update={"clock_measured": True})


def test_a_board_whose_clock_was_never_measured_is_warned_of():
    clock = Clock()
    bus = FakeSmbus({0x40: Pca9685Fake()})
    with pytest.warns(UserWarning, match=r"neutral is a throttle of up to 29 %.*docs/real_car.md says how"):
        TralCarEnv(output="pca9685", bus=bus, clock=clock, sleep=clock.sleep).close()


@pytest.mark.parametrize(
    "options", [{}, {"output": "recorder"}, {"output": "pca9685", "bus": FakeSmbus({0x40: Pca9685Fake()})}]
)
def test_limits_that_nothing_would_keep_are_refused(options):
    with pytest.raises(
        ConfigError, match="limits= has an effect only with config=, or with output='pca9685' and a bus"
    ):
        car(limits=Limits(max_throttle=0.1), **options)


@pytest.mark.parametrize("bus", [1.0, True, object()])
def test_what_is_no_bus_is_refused(bus):
    with pytest.raises(ConfigError, match=r"expected a number \(1 is /dev/i2c-1\), a path, or an object"):
        car(output="pca9685", bus=bus, calibration=MEASURED)


def test_sensors_that_were_opened_by_name_are_closed_where_a_group_is_refused(monkeypatch):
    stopped = []
    bus = FakeSmbus({0x40: Pca9685Fake()})
    monkeypatch.setattr(SonarArray, "stop", lambda array: stopped.append(array))
    with pytest.raises(ConfigError, match="do not provide battery"):
        car(output="pca9685", calibration=MEASURED, sensors="srf08", bus=bus, groups=("battery",))
    assert len(stopped) == 1


@pytest.mark.parametrize("output", [None, "recorder"])
def test_a_dry_run_writes_to_no_bus(output):
    bus = FakeSmbus({0x70 + i: Srf08Fake(Clock(), 1.0) for i in range(3)})
    with pytest.raises(ConfigError, match="a dry run and writes to no bus"):
        car(output=output, sensors="srf08", bus=bus)
    env, _ = car(output=output, bus=bus)
    env.reset()
    env.step(GO)
    env.close()
    assert bus.log == []


def test_the_slew_limit_begins_anew_at_a_reset():
    slow = TT01.model_copy(update={"throttle": TT01.throttle.model_copy(update={"slew_per_s": 0.8})})
    env, _ = car(calibration=slow)
    env.reset()
    for _ in range(100):
        env.step(np.array([0.0, 1.0]))
    observation, _ = env.reset()
    assert CORE_LAYOUT.unpack(observation)["throttle"] == 0.0
    assert env.step(np.array([0.0, 1.0]))[4]["throttle_us"] == pytest.approx(1530 - 0.01 * 390)


def test_a_policy_drives_the_whole_car_for_200_steps():
    env, _, chip, _ = metal()
    observation, _ = env.reset(seed=3)
    ages = []
    for _ in range(200):
        values = CORE_LAYOUT.unpack(observation)
        steering = np.clip(2.0 * (values["ultrasonic_left"] - 0.7), -1, 1)
        observation, _, terminated, truncated, info = env.step(np.array([steering, 0.3], np.float32))
        assert env.observation_space.contains(observation)
        assert not terminated
        assert not truncated
        ages.append(CORE_LAYOUT.unpack(observation)["ultrasonic_left_age"])
    assert info["late_ticks"] == 0
    assert max(ages[10:]) <= 0.065 + 4 * PERIOD_S
    assert CORE_LAYOUT.unpack(observation)["steering"] == pytest.approx(0.2, abs=1e-3)
    assert chip.pulse_us(0) == pytest.approx(1530 - 0.2 * 290, abs=2.2)
    assert chip.pulse_us(1) == pytest.approx(1530 - 0.3 * 390, abs=2.2)
    env.close()
    assert chip.seen[0] == chip.seen[-1] == (361 * 4.24, 361 * 4.24)


def test_a_bus_that_stutters_once_stops_the_car():
    env, bus, chip, _ = metal()
    env.reset()
    env.step(GO)
    bus.failures = 1
    with pytest.raises(HardwareError, match="PCA9685 at 0x40"):
        env.step(GO)
    assert chip.seen[-1] == (361 * 4.24, 361 * 4.24)
    env.close()


def test_a_bus_that_died_says_to_cut_the_power():
    env, bus, _, _ = metal()
    env.reset()
    bus.failures = 10**6
    with pytest.raises(HardwareError) as caught:
        env.step(GO)
    assert "cut the power" in caught.value.__notes__[0]
    bus.failures = 0
    env.close()


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"calibration": "tt02"}, CalibrationError, "did you mean 'tt01'"),
        ({"output": "pca9865"}, ConfigError, "did you mean 'pca9685'"),
        ({"sensors": "srf8"}, ConfigError, "did you mean 'srf08'"),
        ({"groups": ("imy",)}, ConfigError, "did you mean 'imu'"),
        ({"max_duration_s": 0.0}, ConfigError, "above 0"),
        ({"max_duration_s": "60"}, ConfigError, "max_duration_s = '60': expected a finite number of s"),
        ({"max_duration_s": True}, ConfigError, "max_duration_s = True: expected a finite number of s"),
        ({"render_mode": "human"}, ConfigError, "has none"),
    ],
)
def test_options_that_do_not_exist_are_refused(options, error, message):
    with pytest.raises(error, match=message):
        car(**options)


def test_a_group_that_the_sensors_do_not_provide_is_refused():
    with pytest.raises(
        ConfigError, match=r"do not provide battery of the group 'battery'. They provide nothing by name"
    ):
        car(groups=("battery",))
    with pytest.raises(ConfigError, match="do not provide battery"):
        car(groups=iter(("battery",)))
    sensors = SensorGroup(HallCounter())
    with pytest.raises(
        ConfigError, match=r"imu_gyro_x, .*imu_accel_z of the group 'imu'. They provide distance, speed:"
    ):
        car(groups=("imu",), sensors=sensors)


def test_a_group_that_the_sensors_provide_is_read():
    battery = Fixed(battery=7.5)
    battery.provided_readings = frozenset({"battery"})
    env, _ = car(groups=("battery",), sensors=SensorGroup(HallCounter(), battery))
    observation, _ = env.reset()
    assert observation[-1] == 7.5
    env.close()


@pytest.mark.parametrize(
    ("arguments", "error", "told"),
    [({"options": {"course": "x"}}, ConfigError, "course"), ({"seed": -1}, gym.error.Error, "Seed")],
)
def test_a_reset_that_is_refused_stops_a_car_that_drives(
    arguments: dict[str, Any], error: type[Exception], told: str
) -> None:
    env, _ = car()
    env.reset()
    for _ in range(40):
        info = env.step([0.0, 0.8])[-1]
    neutral = env.unwrapped.calibration.neutral_us
    assert info["throttle_us"] != neutral[1]
    with pytest.raises(error, match=told):
        env.reset(**arguments)
    last = env.unwrapped.output.sent[-1]
    assert (last.steering_us, last.throttle_us) == pytest.approx(tuple(neutral), abs=1e-9)
    with pytest.raises(ResetNeeded):
        env.step([0.0, 0.8])


def test_sensors_are_stopped_at_the_end():
    sensors = Broken(1, OSError())
    env, _ = car(sensors=sensors)
    env.close()
    assert sensors.stopped


def test_the_cars_computer_needs_neither_physics_nor_learning():
    program = """
import sys, pkgutil, importlib, gymnasium, tral_env, tral_env.hardware
for module in pkgutil.walk_packages(tral_env.hardware.__path__, "tral_env.hardware."):
    if module.name != "tral_env.hardware.camera":  # OpenCV is for cars with a camera
        importlib.import_module(module.name)
env = gymnasium.make("TralCar-v0"); env.reset(); env.step(env.action_space.sample()); env.close()
print(*sorted({"mujoco", "torch", "stable_baselines3", "smbus2", "cv2", "matplotlib"} & set(sys.modules)))
"""
    run = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


RANGES = {f"ultrasonic_{side}{what}" for side in ("left", "front", "right") for what in ("", "_age")}
COMMANDS = {"steering", "throttle"}


@pytest.mark.parametrize(
    ("sensors", "provided"),
    [
        (lambda: None, COMMANDS),
        (lambda: SonarArray(FakeSmbus({})), COMMANDS | RANGES),
        (lambda: HallCounter(), COMMANDS | {"distance", "speed"}),
        (lambda: SensorGroup(SonarArray(FakeSmbus({})), HallCounter()), COMMANDS | RANGES | {"distance", "speed"}),
        (
            lambda: SonarArray(FakeSmbus({}), addresses={"front": 0x71}),
            COMMANDS | {name for name in RANGES if "front" in name},
        ),
    ],
)
def test_the_car_says_which_readings_it_has(sensors, provided):
    assert car(sensors=sensors())[0].provided_readings == provided


def test_sensors_that_do_not_say_what_they_read_leave_it_open():
    assert car(sensors=Fixed())[0].provided_readings is None
    assert car(sensors=SensorGroup(Fixed(), HallCounter()))[0].provided_readings is None


class NeedsHall:
    needed_readings = frozenset({"distance", "ultrasonic_front"})


def test_a_policy_that_needs_a_missing_sensor_is_refused_before_the_first_reset():
    env, _ = car(sensors=SonarArray(FakeSmbus({})))
    with pytest.raises(ConfigError, match="needs distance, which this car does not read; it reads ultrasonic_front"):
        check_readings(NeedsHall(), env)


def test_a_reading_of_an_optional_group_that_is_missing_is_named_too():
    class Turner:
        needed_readings = frozenset({"imu_gyro_z", "distance"})

    env, _ = car()
    with pytest.raises(ConfigError, match=r"the policy needs distance, imu_gyro_z, which this car does not read"):
        check_readings(Turner(), env)
