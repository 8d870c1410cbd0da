"""The twin by hand: the car's own environment drives the simulated car, on a clock that waits for nobody."""

import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from twins import Clock, twin_by_hand

from tral_env.errors import ConfigError, SimulationError
from tral_env.hardware.calibration_file import load_calibration
from tral_env.hardware.sensors import HallCounter, SensorGroup
from tral_env.hardware.sonar import SonarArray
from tral_env.twin.car import bounces
from tral_env.twin.settings import TwinSettings
from tral_env.twin.twin import Twin
from tral_fsm import load_policy

STRAIGHT = {"scenario": "straight", "seed": 3}


class Heard(HallCounter):
    """A hall counter that takes the edges that a twin by hand has gathered."""

    def __init__(self, twin: Any) -> None:
        self._when = 0.0
        super().__init__(clock=lambda: self._when)
        self._twin = twin

    def read(self, now: float) -> Any:
        for when in self._twin.heard:
            self._when = when
            self.edge()
        self._twin.heard.clear()
        return super().read(now)


def car_at(twin: Twin, clock: Clock, knows_clock: bool = True, **options: Any) -> gym.Env[Any, Any]:
    hz = float(twin.pca9685.oscillator_hz) if knows_clock else 25e6
    calibration = load_calibration("tt01").model_copy(update={"oscillator_hz": hz, "clock_measured": True})
    return gym.make(
        "tral_env:TralCar-v0",
        calibration=calibration,
        output="pca9685",
        bus=twin.smbus,
        clock=clock,
        sleep=clock.sleep,
        disable_env_checker=True,
        **options,
    )


def drive(twin: Twin, clock: Clock, car: gym.Env[Any, Any], machine: str) -> None:
    clock.sleep(1.0)  # neutral stands, as the actuator's process lets it
    policy = load_policy(machine)
    policy.reset()
    observation, _ = car.reset()
    ended = False
    while not ended and twin.outcome() is None:
        observation, _, _, ended, _ = car.step(policy.act(observation))
    car.close()


def test_a_machine_drives_the_twin_to_the_goal() -> None:
    twin, clock = twin_by_hand(**STRAIGHT)
    sensors = SensorGroup(SonarArray(twin.smbus, sleep=clock.sleep), Heard(twin))
    drive(twin, clock, car_at(twin, clock, sensors=sensors), "wall")
    outcome = twin.outcome()
    assert outcome is not None
    assert outcome["ended"] == "success"
    assert outcome["progress"] == 1.0
    twin.close()


def test_the_boards_clock_is_drawn_and_a_calibration_that_does_not_know_it_drives_in_neutral() -> None:
    settings = TwinSettings(**STRAIGHT)
    assert 24.0e6 <= settings.clock_hz <= 28.7e6
    assert settings.clock_hz == TwinSettings(**STRAIGHT).clock_hz
    assert len({TwinSettings(seed=seed).clock_hz for seed in range(20)}) == 20
    twin, clock = twin_by_hand(**STRAIGHT, oscillator_hz=27e6)
    car = car_at(twin, clock, knows_clock=False)
    assert twin.status()["throttle_us"] == pytest.approx(1530 * 25 / 27, abs=2.5)
    car.close()
    twin.close()


def test_a_pulse_moves_the_car_once_the_controller_is_armed() -> None:
    twin, clock = twin_by_hand(**STRAIGHT, randomization="none")
    car = car_at(twin, clock)
    car.reset()
    car.step(np.array([0.0, 0.5]))
    assert not twin.controller.armed  # neutral has not stood for long enough
    clock.sleep(1.0)
    car.reset()
    clock.sleep(1.0)
    for _ in range(80):
        car.step(np.array([0.0, 0.5]))
    assert twin.car.info["speed_mps"] == pytest.approx(1.0, abs=0.1)
    car.close()
    twin.close()


def test_the_ultrasonics_answer_what_the_simulated_ones_measure() -> None:
    twin, clock = twin_by_hand(**STRAIGHT, randomization="none")
    sonars = SonarArray(twin.smbus, sleep=clock.sleep)
    car = car_at(twin, clock, sensors=sonars)
    observation, _ = car.reset()
    for _ in range(20):
        observation, *_ = car.step(np.zeros(2))
    names = [field.name for field in car.unwrapped._layout.fields]  # type: ignore[attr-defined]
    left = observation[names.index("ultrasonic_left")]
    assert left == pytest.approx(twin.car.info["clearance_left_m"], abs=0.02)
    car.close()
    twin.close()


def test_echoes_are_the_wall_and_its_bounces() -> None:
    assert bounces(1.5) == [1.5, 3.0, 4.5]
    assert bounces(6.0) == []


def test_a_reset_puts_the_car_at_the_start_of_another_course() -> None:
    twin, _ = twin_by_hand(**STRAIGHT)
    first = twin.car.plan.length
    twin.reset(4)
    assert twin.car.plan.length != first
    assert twin.status()["seed"] == 4
    twin.reset(3)
    assert twin.car.plan.length == first
    twin.close()


def test_the_course_and_the_car_are_those_of_the_simulated_environment() -> None:
    twin, _ = twin_by_hand(**STRAIGHT)
    env = gym.make("tral_env:TralCorridor-v0", scenario="straight")
    _, info = env.reset(seed=3)
    own = {name: value for name, value in info["car"].items() if not name.startswith("sonar")}
    assert {name: twin.car.drawn[name] for name in own} == own
    assert env.unwrapped.plan.length == twin.car.plan.length  # type: ignore[attr-defined]
    env.close()
    twin.close()


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"board": "arduino"}, "board = 'arduino'"),
        ({"scenario": "moon"}, "moon"),
        ({"seed": -1}, "seed = -1"),
        ({"name": "a/b"}, "name = 'a/b'"),
        ({"oscillator_hz": 25.0}, "oscillator_hz = 25.0"),
        ({"bus": 1000}, "bus = 1000"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        TwinSettings(**settings)


def test_settings_survive_json() -> None:
    settings = TwinSettings(name="other", seed=4, board="ucboard", bus=None)
    assert TwinSettings.from_json(settings.to_json()) == settings
    with pytest.raises(ConfigError, match="unknown setting 'sed': did you mean 'seed'"):
        TwinSettings.from_json('{"sed": 4}')


def test_physics_that_fails_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    twin = Twin(TwinSettings(**STRAIGHT, files=False, serial=False, folder=str(tmp_path)))

    def fails(*_: Any, **__: Any) -> None:
        raise SimulationError("unstable physics in rows [0]")

    monkeypatch.setattr(twin.car, "tick", fails)
    with twin:
        until_s = time.monotonic() + 10.0
        while not twin.status()["failure"]:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        assert twin.status()["failure"] == "unstable physics in rows [0]"


def test_a_twin_without_files_says_why() -> None:
    twin, _ = twin_by_hand(**STRAIGHT)
    assert twin.status()["i2c"] is None
    with pytest.raises(ConfigError, match="the settings ask for none"):
        _ = twin.i2c_path
    twin.close()
