"""Sensors that go silent: the machine says what it needs, the watch stops the car."""

import math
from typing import Any

import numpy as np
import pytest
from readings import Bench, one_state, two_states
from toy import Toy, corner, one_car, straight

from tral_env.errors import ConfigError
from tral_env.interface import CORE_LAYOUT, check_readings
from tral_fsm import Driver, load_machine, load_policy, machine_names
from tral_fsm.control.speed import BRAKE
from tral_fsm.definition.machine import needed_readings
from tral_fsm.formats.library import by_name
from tral_fsm.runtime.watch import Watch

SIDES = {"ultrasonic_left", "ultrasonic_right"}
HALL = {"distance", "speed"}


def needed_by(bench: Bench) -> set[str]:
    return set(needed_readings(bench.driver.machine.definition, by_name))


@pytest.mark.parametrize(
    ("state", "needed"),
    [
        ({"type": "Motor", "throttle": 0.2}, set()),
        ({"type": "Motor", "speed": 0.5}, HALL),
        ({"type": "Motor", "throttle": 0.2, "distance": 1.0}, {"distance"}),
        ({"type": "Stop"}, {"speed"}),
        ({"type": "Stop", "hold": 0.5}, set()),
        ({"type": "Idle"}, set()),
        ({"type": "FollowWall", "side": "left", "throttle": 0.2}, {"ultrasonic_left"}),
        ({"type": "FollowWall", "side": "right", "speed": 0.5}, {"ultrasonic_right", *HALL}),
        ({"type": "FollowWall", "throttle": 0.2, "at_most_half": True}, SIDES),
        ({"type": "BasicFollowWall", "speed": 0.5, "slow_front": 2.0}, {"ultrasonic_right", "ultrasonic_front", *HALL}),
        ({"type": "FollowCorridor", "speed": 0.5}, SIDES | HALL),
        ({"type": "Turn", "throttle": 0.2}, {"distance"}),
        ({"type": "FSMState", "machine": "doors"}, SIDES | HALL),
    ],
)
def test_a_state_needs_the_readings_that_its_parameters_ask_for(state: dict[str, Any], needed: set[str]) -> None:
    assert needed_by(one_state(**state)) == needed


@pytest.mark.parametrize(
    ("transition", "needed"),
    [
        ({"type": "Timer", "seconds": 1.0}, set()),
        ({"type": "Distance", "distance": 1.0}, {"distance"}),
        ({"type": "SensorLevel", "sensor": "left", "below": 1.0}, {"ultrasonic_left"}),
        ({"type": "ObstacleAhead", "below": 1.0}, {"ultrasonic_front"}),
        ({"type": "ObstacleAhead"}, {"ultrasonic_front", *HALL}),
        ({"type": "Opening", "side": "right"}, {"ultrasonic_right", "distance"}),
        (
            {"type": "Any", "of": [{"type": "Timer", "seconds": 1.0}, {"type": "Turned", "angle_deg": 90.0}]},
            {"distance"},
        ),
    ],
)
def test_a_condition_needs_the_readings_that_it_compares(transition: dict[str, Any], needed: set[str]) -> None:
    assert needed_by(two_states(transition, second={"type": "Idle"})) == needed


def test_only_machines_that_ask_for_gates_need_the_camera() -> None:
    needs = {name: load_policy(name).needed_readings for name in machine_names()}
    assert {name for name, needed in needs.items() if "gate_id" in needed} == {
        "gate", "gate_scurve", "known_route", "office",
    }  # fmt: skip


class Car:
    """An env of which only the sensors matter."""

    def __init__(self, *readings: str) -> None:
        self.unwrapped = self
        self.provided_readings = frozenset(readings)


def test_a_policy_that_needs_more_than_the_car_reads_is_refused() -> None:
    car = Car("ultrasonic_left", "ultrasonic_front", "ultrasonic_right")
    with pytest.raises(ConfigError, match="needs distance, speed, which this car does not read"):
        check_readings(load_policy("wall"), car)


def test_what_says_nothing_of_its_readings_is_not_checked() -> None:
    check_readings(load_policy("office"), object())


TICKS_TO_SILENCE, TICKS_TO_STANDSTILL = 40, 96
"""0.5 s and 1.2 s."""


def ticks_until_stopped(bench: Bench, most: int, **readings: float) -> int:
    """Ticks for which the car drives on."""
    for tick in range(most):
        bench.tick(**readings)
        if bench.active.startswith("stopped"):
            return tick
    return most


def test_an_ultrasonic_that_never_reads_stops_the_car_after_half_a_second() -> None:
    bench = one_state(type="FollowWall", throttle=0.2)
    assert ticks_until_stopped(bench, 100) == TICKS_TO_SILENCE
    assert bench.active == "stopped: ultrasonic_right silent for 0.5 s"


def test_an_ultrasonic_that_the_machine_does_not_need_may_be_silent() -> None:
    bench = one_state(type="FollowWall", throttle=0.2)
    assert ticks_until_stopped(bench, 100, right=0.8) == 100


def test_an_ultrasonic_that_goes_silent_stops_the_car() -> None:
    bench = one_state(type="FollowWall", throttle=0.2)
    for _ in range(100):
        bench.tick(right=0.8)
    assert ticks_until_stopped(bench, 100) == pytest.approx(TICKS_TO_SILENCE, abs=1)


def test_a_stopped_car_brakes_while_it_rolls_and_stays_until_a_reset() -> None:
    bench = one_state(type="FollowWall", speed=0.5)
    ticks_until_stopped(bench, 100, speed=0.5, distance=1.0)
    assert bench.tick(speed=0.5) == (0.0, -0.3)
    assert bench.tick(speed=0.0, right=0.8) == (0.0, 0.0)
    assert bench.active == "stopped: ultrasonic_right silent for 0.5 s"
    bench.reset()
    assert bench.tick(right=0.8)[1] > 0.0
    assert bench.active == "0"


def test_a_regulated_car_that_never_moves_is_stopped_and_brakes_blindly_for_a_second() -> None:
    bench = one_state(type="Motor", speed=0.5)
    pause = 16  # ticks of neutral after the first second
    assert ticks_until_stopped(bench, 400) == TICKS_TO_STANDSTILL + pause
    assert "told to drive for 1.2 s" in bench.active
    throttles = [bench.tick()[1] for _ in range(100)]
    assert throttles == [-0.3] * 79 + [0.0] * 21


def test_a_hall_sensor_that_dies_on_a_car_that_is_driven_on_is_noticed_in_half_a_second() -> None:
    bench = one_state(type="Motor", speed=0.5)
    for tick in range(80):
        bench.tick(distance=0.00625 * tick, speed=0.5)
    assert ticks_until_stopped(bench, 100, speed=0.0) == TICKS_TO_SILENCE
    assert bench.active == "stopped: no hall tick for 0.5 s of driving on from 0.5 m/s"


BRAKES_THEN_DRIVES = {"type": "Motor", "throttle": 0.0}, {"type": "Motor", "speed": 0.4}


def ticks_after_coasting(seconds: float) -> int:
    """Ticks of driving on until a car is stopped whose hall sensor died at 1.2 m/s, as it began to coast."""
    coasting, driving = BRAKES_THEN_DRIVES
    bench = two_states({"type": "Timer", "seconds": 0.5 + seconds}, first=coasting, second=driving)
    for tick in range(40):
        bench.tick(distance=0.015 * tick, speed=1.2)
    while bench.active == "a":
        bench.tick(speed=0.0)
    return ticks_until_stopped(bench, 200)


def test_a_hall_sensor_that_dies_while_the_car_coasts_is_noticed_when_it_is_driven_on() -> None:
    assert ticks_after_coasting(0.1) == pytest.approx(TICKS_TO_SILENCE, abs=2)


def test_a_car_that_may_have_come_to_rest_gets_time_to_move_off() -> None:
    assert ticks_after_coasting(1.0) > TICKS_TO_STANDSTILL


@pytest.mark.parametrize(
    "state",
    [
        {"type": "Stop", "hold": 10.0},
        {"type": "Idle"},
        {"type": "Motor", "throttle": 0.2},
        {"type": "Motor", "speed": 0.0},
    ],
)
def test_a_car_that_brakes_waits_or_is_driven_open_loop_may_stand(state: dict[str, Any]) -> None:
    assert ticks_until_stopped(one_state(**state), 400) == 400


def test_a_car_that_moves_a_tick_now_and_then_is_not_stopped() -> None:
    bench = one_state(type="Motor", speed=0.1)
    for tick in range(800):
        bench.tick(distance=0.025 * (tick // 80))
    assert bench.active == "0"


def drive_blind(toy: Toy, machine: str, seconds: float, **blind: float) -> Driver:
    """Drive with some readings replaced."""
    driver = Driver(load_machine(machine))
    act = one_car(driver)

    def fault(observation: np.ndarray) -> np.ndarray:
        values = dict(zip(CORE_LAYOUT.names, observation.tolist(), strict=True)) | blind
        return act(CORE_LAYOUT.pack(values, 1)[0])

    toy.drive(fault, seconds)
    return driver


def test_the_machine_office_without_its_front_ultrasonic_stops_before_a_corner() -> None:
    toy = corner("left", 2.0, 5.0)
    driver = drive_blind(toy, "office", 6.0, ultrasonic_front=6.0, ultrasonic_front_age=10.0)
    assert driver.active_path == "stopped: ultrasonic_front silent for 0.5 s"
    assert toy.x < 1.0


def test_the_machine_wall_without_a_hall_sensor_does_not_wind_its_throttle_up() -> None:
    driver = drive_blind(straight(2.0), "wall", 6.0, distance=0.0, speed=0.0)
    assert driver.active_path.startswith("stopped: told to drive for 1.2 s")
    assert driver.act(CORE_LAYOUT.pack({}, 1)[0])[1] == 0.0


def test_a_car_with_1500_m_on_its_odometer_drives_as_one_with_0() -> None:
    ends = []
    for offset in (0.0, 1500.0):
        toy, act = corner("left", 2.0, 5.0), one_car(Driver(load_machine("corners")))

        def with_offset(observation: np.ndarray, act: Any = act, offset: float = offset) -> np.ndarray:
            values = dict(zip(CORE_LAYOUT.names, observation.tolist(), strict=True))
            return act(CORE_LAYOUT.pack(values | {"distance": values["distance"] + offset}, 1)[0])

        toy.drive(with_offset, 9.0)
        ends.append(toy.path)
    gaps = [math.dist(a[:2], b[:2]) for a, b in zip(*ends, strict=True)]
    assert max(gaps) < 0.02
    assert ends[0][-1][2] == pytest.approx(math.pi / 2, abs=0.3)


def test_a_stopped_car_brakes_once_whatever_the_hall_sensor_still_says() -> None:
    watch = Watch(frozenset({"speed"}))
    told = [watch.stop(speed, 1.0).throttle for speed in (0.5, 0.2, 0.0, 0.2, 0.5)]
    assert told == [-BRAKE, -BRAKE, 0.0, 0.0, 0.0]
    watch.reset()
    assert watch.stop(0.5, -1.0).throttle == BRAKE
