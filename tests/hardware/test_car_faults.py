"""The environment of the real car notices faults, stops the car, and says so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fakes import Clock
from gymnasium.error import ResetNeeded

from tral_env.errors import CarStoppedError
from tral_env.hardware.env import TralCarEnv
from tral_env.hardware.episode import Episode
from tral_env.hardware.faults import FaultLimits
from tral_env.hardware.sensors import ImageTimes, SensorGroup, image_times

GO = np.array([0.0, 0.2], np.float32)
NEUTRAL = (1530.0, 1530.0)


class Told:
    """Sensors that say what a test says."""

    def __init__(self, **readings: float) -> None:
        self.readings = readings
        self.provided_readings = frozenset(readings)

    def start(self) -> None:
        pass

    def read(self, now: float) -> dict[str, float]:
        return self.readings

    def stop(self) -> None:
        pass


class Eye(Told):
    """A camera that stands still."""

    image_times = ImageTimes(100.0, 100.0)


def car(sensors: Any, faults: FaultLimits | None = FaultLimits()) -> tuple[TralCarEnv, Clock]:  # noqa: B008
    clock = Clock()
    return TralCarEnv(clock=clock, sleep=clock.sleep, sensors=sensors, faults=faults), clock


def sent(env: Any) -> tuple[float, float]:
    return env.output.sent[-1].steering_us, env.output.sent[-1].throttle_us


def drive(env: TralCarEnv, ticks: int) -> dict[str, Any]:
    env.reset()
    for _ in range(ticks):
        *_, info = env.step(GO)
    return info


def test_a_fault_stops_the_car_before_the_error_and_only_a_reset_drives_again() -> None:
    env, _ = car(Told(distance=0.0, speed=0.0))
    with pytest.raises(CarStoppedError, match="STOP no motion"):
        drive(env, 400)
    assert sent(env) == NEUTRAL
    with pytest.raises(ResetNeeded):
        env.step(GO)
    drive(env, 10)
    assert sent(env) != NEUTRAL
    env.close()


def test_without_a_board_that_drives_no_fault_stops_a_dry_run() -> None:
    env, _ = car(Told(distance=0.0, speed=0.0), None)
    assert "warnings" not in drive(env, 400)
    env.close()


def test_a_voltage_that_flickers_is_no_evidence_that_the_sensors_live() -> None:
    episode = Episode()
    for tick in range(10):
        episode.weigh({"distance": 0.5, "ultrasonic_left": 1.0, "ultrasonic_left_age": 0.01 * tick, "battery": tick})
    assert episode.evidence == 1
    episode.weigh({"distance": 0.525, "ultrasonic_left": 1.0, "battery": 7.0})
    assert episode.evidence == 2


def test_warnings_stand_in_the_info() -> None:
    env, _ = car(Told(battery=6.3))
    (warning,) = drive(env, 400)["warnings"]
    assert warning.startswith("WARN battery low: 6.3 V")
    env.close()


def test_a_camera_is_watched_wherever_it_is_among_the_sensors() -> None:
    assert image_times(SensorGroup(Told(), Eye(), Eye())) == ImageTimes(100.0, 100.0)
    assert image_times(SensorGroup(Told())) is None
    assert image_times(None) is None
    env, _ = car(SensorGroup(Told(), Eye()))
    with pytest.raises(CarStoppedError, match=r"STOP camera stale: the newest image is 0\.5 s old"):
        drive(env, 80)
    env.close()


def test_an_emergency_stop_lasts_until_the_reset() -> None:
    env, _ = car(None)
    drive(env, 3)
    env.stop()
    assert sent(env) == NEUTRAL
    with pytest.raises(ResetNeeded):
        env.step(GO)
    drive(env, 1)
    env.close()


def test_what_the_observation_has_no_field_for_is_a_reading_too() -> None:
    env, _ = car(Told(battery=7.2))
    drive(env, 1)
    assert env.readings == {"battery": 7.2}
    assert env.retries == 0
    env.close()
