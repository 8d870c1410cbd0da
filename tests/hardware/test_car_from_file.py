"""TralCar-v0 made from a car file: what is opened, in which order, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from fakes import Clock, FakeSmbus, Pca9685Fake, Srf08Fake

from tral_env.errors import CarStoppedError, ConfigError, HardwareError
from tral_env.hardware import opening, sensor_drivers
from tral_env.hardware.actuator.settings import Limits, Settings
from tral_env.hardware.car_file import CarFile, parse_car
from tral_env.hardware.commands import PulseActuator
from tral_env.hardware.env import TralCarEnv
from tral_env.hardware.faults import FaultLimits
from tral_env.hardware.opening import open_sensors
from tral_env.hardware.pwm import Recorder
from tral_env.interface import CORE_LAYOUT, OPTIONAL_GROUPS, action_space

FILE = """\
version = 1
name = "mine"
[board]
driver = "pca9685"
clock_measured = true
[pulses]
file = "tt01"
[limits]
max_throttle = 0.4
"""
SONARS = '[[sensors]]\ndriver = "srf08"\n'
SONAR_READINGS = {f"ultrasonic_{side}{what}" for side in ("left", "front", "right") for what in ("", "_age")}


class Actuator(PulseActuator):
    """Stands in for the actuator's process."""

    told: Settings

    def __init__(self, settings: Settings) -> None:
        type(self).told = settings
        calibration = parse_car(FILE).calibration
        super().__init__(Recorder(calibration), calibration)


@pytest.fixture
def actuator(monkeypatch: pytest.MonkeyPatch) -> type[Actuator]:
    monkeypatch.setattr(opening, "ActuatorProcess", Actuator)
    return Actuator


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> FakeSmbus:
    """Three ultrasonics on bus 1, on the clock of the tests."""
    smbus2 = pytest.importorskip("smbus2")
    clock = Clock()
    made = FakeSmbus({0x40: Pca9685Fake(), **{address: Srf08Fake(clock) for address in (0x70, 0x71, 0x72)}})
    monkeypatch.setattr(smbus2, "SMBus", lambda number: made)
    return made


def drive(env: TralCarEnv, throttle: float, ticks: int = 400) -> None:
    env.reset()
    for _ in range(ticks):
        env.step(np.array([0.0, throttle], np.float32))


def made(text: str = FILE, **options: Any) -> TralCarEnv:
    clock = Clock()
    return TralCarEnv(config=parse_car(text), clock=clock, sleep=clock.sleep, **options)


def test_the_spaces_are_those_of_every_car(tmp_path: Path, actuator: type[Actuator]) -> None:
    (tmp_path / "car.toml").write_text(FILE)
    env = gym.make("tral_env:TralCar-v0", config=str(tmp_path / "car.toml"))
    assert env.observation_space == CORE_LAYOUT.space()
    assert env.action_space == action_space()
    assert env.unwrapped.calibration.name == "mine"
    assert actuator.told.driver == "pca9685"
    env.close()


def test_the_actuators_process_gets_the_limits_of_the_file(actuator: type[Actuator], bus: FakeSmbus) -> None:
    made(FILE + SONARS).close()
    assert actuator.told.limits == Limits(max_throttle=0.4)
    made(FILE + SONARS, limits=Limits(max_throttle=0.2)).close()
    assert actuator.told.limits == Limits(max_throttle=0.2)
    assert bus.closed


@pytest.mark.parametrize("options", [{"sensors": "none"}, {}])
def test_a_car_without_sensors_has_no_law_about_frozen_ones(actuator: type[Actuator], options: dict[str, str]) -> None:
    env = made(FILE + SONARS * bool(options), **options)
    assert actuator.told.limits == Limits(max_throttle=0.4, evidence_s=None)
    assert env.sensors is None


def test_a_dry_run_needs_no_measured_clock() -> None:
    env = made(FILE.replace("true", "false"), output="recorder")
    env.reset()
    env.step(np.array([0.0, 1.0], np.float32))
    assert env.output.sent[-1].throttle_us == 1140.0
    own = Recorder(env.calibration)
    assert made(FILE.replace("true", "false"), output=own).output is own


def test_a_dry_run_writes_nothing_to_the_bus_of_a_board_that_was_not_set_up(bus: FakeSmbus) -> None:
    env = made(FILE + SONARS, output="recorder")
    drive(env, 0.3, 80)
    assert bus.log == []
    assert env.readings == {}
    assert env.provided_readings == SONAR_READINGS | {"steering", "throttle"}
    env.close()


def test_a_dry_run_does_not_wait_for_a_serial_board_that_only_its_driver_sets_up() -> None:
    text = FILE.replace('"pca9685"', '"ucboard"\nport = "/dev/no_such_port"').replace("clock_measured = true\n", "")
    env = made(text + '[[sensors]]\ndriver = "ucboard"\nport = "/dev/no_such_port"\n', output="recorder")
    env.reset()
    env.step(np.array([0.0, 0.3], np.float32))
    assert env.provided_readings is not None
    assert env.provided_readings >= SONAR_READINGS | {"distance", "speed", "battery"}
    env.close()


def test_a_dry_run_opens_sensors_on_a_bus_without_a_board(bus: FakeSmbus) -> None:
    env = made(FILE + SONARS + "bus = 2\n", output="recorder")
    env.reset()
    assert bus.log
    env.close()


@pytest.mark.usefixtures("actuator")
def test_a_board_whose_clock_was_never_measured_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"'mine': the clock of the board was never measured.*tral car calibrate"):
        made(FILE.replace("true", "false"))


def test_a_board_without_a_clock_of_its_own_is_not_asked_for_one(actuator: type[Actuator]) -> None:
    serial = FILE.replace('driver = "pca9685"\nclock_measured = true', 'driver = "log"\nperiod_us = 17430')
    made(serial).close()
    assert actuator.told.driver == "log"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"calibration": "tt01"}, "calibration= beside config=: the car file says it"),
        ({"bus": 1}, "bus= beside config="),
        ({"output": "pca9685"}, "output='pca9685' beside config=: the car file names the board"),
        ({"sensors": "srf08", "output": "recorder"}, "sensors='srf08' beside config="),
        ({"limits": Limits(), "output": "recorder"}, "limits= has an effect on the board of the car file alone"),
    ],
)
def test_what_the_file_says_cannot_be_given_twice(options: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        made(**options)


@dataclass(frozen=True, kw_only=True)
class ThermometerOptions:
    """Sensors of another distribution."""

    volts: float = 7.0
    opens: bool = True

    def open(self, clock: Any, sleep: Any) -> Any:
        del clock, sleep
        if not self.opens:
            raise HardwareError("no answer")
        return Thermometer(self.volts)


class Thermometer:
    stopped: list[float] = []  # noqa: RUF012
    provided_readings = frozenset({"battery"})

    def __init__(self, volts: float) -> None:
        self.volts = volts

    def start(self) -> None:
        """Begin."""

    def read(self, now: float) -> dict[str, float]:
        del now
        return {"battery": self.volts}

    def stop(self) -> None:
        self.stopped.append(self.volts)


@pytest.fixture
def plugin(monkeypatch: pytest.MonkeyPatch) -> None:
    entries = [
        EntryPoint("volts", f"{__name__}:ThermometerOptions", sensor_drivers.GROUP),
        EntryPoint("broken", "no_such_module:Options", sensor_drivers.GROUP),
    ]

    def found(group: str, **chosen: str) -> list[EntryPoint]:
        assert group == sensor_drivers.GROUP
        return [entry for entry in entries if chosen.get("name") in (None, entry.name)]

    monkeypatch.setattr(sensor_drivers, "entry_points", found)
    Thermometer.stopped.clear()


@pytest.mark.usefixtures("plugin")
def test_sensors_of_another_distribution_are_opened_with_their_options() -> None:
    env = made(FILE + '[[sensors]]\ndriver = "volts"\nvolts = 7.5\n', output="recorder", groups=("battery",))
    observation, _ = env.reset()
    assert observation[-1] == 7.5
    assert env.readings == {"battery": 7.5}


@pytest.mark.usefixtures("plugin")
def test_a_reading_that_the_observation_has_no_field_for_is_kept_beside_it() -> None:
    env = made(FILE + '[[sensors]]\ndriver = "volts"\n', output="recorder")
    observation, _ = env.reset()
    assert CORE_LAYOUT.space().contains(observation)
    assert env.readings == {"battery": 7.0}
    assert {field.name for field in OPTIONAL_GROUPS["battery"]} == set(env.readings)


@pytest.mark.usefixtures("plugin")
@pytest.mark.parametrize("faults", [None, FaultLimits(blind_m=0.4)])
def test_the_battery_of_the_car_file_stops_the_drive_whatever_other_limits_are_given(
    actuator: type[Actuator], faults: FaultLimits | None
) -> None:
    battery = '[[sensors]]\ndriver = "volts"\nvolts = 9\n[battery]\nwarn_v = 11\nstop_v = 10\n'
    env = made(FILE + battery, faults=faults)
    assert actuator.told.driver == "pca9685"
    with pytest.raises(CarStoppedError, match=r"STOP battery empty: 9\.0 V in the mean, below 10 V"):
        drive(env, 0.0)
    env.close()


class Wall:
    """A car at 1 m/s, and a wall that comes near."""

    provided_readings = frozenset({"ultrasonic_front", "ultrasonic_front_age", "distance", "speed"})

    def start(self) -> None:
        """Begin."""

    def read(self, now: float) -> dict[str, float]:
        way = now - 100.0
        return {"ultrasonic_front": 3.0 - way, "ultrasonic_front_age": 0.0, "distance": way, "speed": 1.0}

    def stop(self) -> None:
        """End."""


@pytest.mark.usefixtures("actuator")
@pytest.mark.parametrize(("brake", "left_m"), [(-1.0, 0.44), (0.0, 0.70)])
def test_too_near_is_judged_by_the_brake_of_the_car(brake: float, left_m: float) -> None:
    clock = Clock()
    text = FILE.replace("[limits]", f"[limits]\nbrake = {brake}") + "[pulses.throttle]\ndead_zone_us = 30\n"
    env = TralCarEnv(config=parse_car(text), sensors=Wall(), clock=clock, sleep=clock.sleep)
    with pytest.raises(CarStoppedError, match="STOP too near"):
        drive(env, 0.3)
    assert 3.0 - (clock() - 100.0) == pytest.approx(left_m, abs=0.03)
    env.close()


@pytest.mark.usefixtures("actuator")
def test_the_limits_of_faults_of_the_car_file_count() -> None:
    clock = Clock()
    env = TralCarEnv(
        config=parse_car(FILE + '[faults]\nreaction_s = "off"\n'), sensors=Wall(), clock=clock, sleep=clock.sleep
    )
    drive(env, 0.3, 200)
    assert env.step(np.array([0.0, 0.3], np.float32))[4]["tick"] == 201, "nothing stopped it"
    env.close()


@pytest.mark.usefixtures("plugin")
def test_sensors_that_were_opened_are_let_go_when_a_later_one_fails() -> None:
    text = FILE + '[[sensors]]\ndriver = "volts"\nvolts = 1\n[[sensors]]\ndriver = "volts"\nopens = false\n'
    with pytest.raises(HardwareError, match="no answer"):
        open_sensors(parse_car(text), Clock(), Clock().sleep)
    assert Thermometer.stopped == [1.0]


@pytest.mark.usefixtures("plugin")
def test_sensors_that_cannot_be_loaded_are_told_by_name() -> None:
    with pytest.raises(
        ConfigError, match=r"sensors\[1\]\.driver: the sensor 'broken' \(no_such_module:Options\) cannot"
    ):
        parse_car(FILE + '[[sensors]]\ndriver = "broken"\n')


def test_a_camera_that_was_not_calibrated_stays_off_and_one_with_a_lens_is_opened(monkeypatch: Any) -> None:
    assert open_sensors(parse_car(FILE + "[camera]\n"), Clock(), Clock().sleep) is None
    opened: list[CarFile] = []
    monkeypatch.setattr("tral_env.hardware.camera.Camera", lambda options, clock: opened.append(options))
    assert open_sensors(parse_car(FILE + '[camera]\nlens = "wide"\n'), Clock(), Clock().sleep) is not None
    assert len(opened) == 1
