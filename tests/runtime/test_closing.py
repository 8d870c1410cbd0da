"""A hall sensor that counts too few ticks: the front ultrasonic shows it."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from readings import Bench, one_state
from toy import Toy, corner, one_car

from tral_env.interface import CORE_LAYOUT
from tral_fsm import Driver, load_machine
from tral_fsm.runtime.closing import READINGS

TICKS_BETWEEN_READINGS = 6


def approach(bench: Bench, *, closing_mps: float, counted_mps: float, start_m: float = 5.0, readings: int = 20) -> str:
    """Drive towards something; gives what the watch said."""
    for tick in range(readings * TICKS_BETWEEN_READINGS):
        time = tick / 80
        front = {"front": start_m - closing_mps * time} if tick % TICKS_BETWEEN_READINGS == 0 else {}
        bench.tick(distance=0.025 * int(counted_mps * time / 0.025), speed=counted_mps, **front)
    return bench.active


def driving() -> Bench:
    return one_state(type="Motor", speed=0.8)


def test_a_hall_sensor_that_counts_half_of_the_ticks_stops_the_car_and_the_reason_has_both_ways() -> None:
    told = approach(driving(), closing_mps=1.6, counted_mps=0.8)
    assert told == (
        "stopped: what is ahead came 0.36 m nearer while the hall sensor counted 0.18 m: it counts too few ticks, or "
        "something comes towards the car"
    )


def test_it_takes_nine_readings() -> None:
    fast: dict[str, Any] = {"closing_mps": 1.6, "counted_mps": 0.8}
    assert approach(driving(), **fast, readings=READINGS - 1) == "0"
    assert approach(driving(), **fast, readings=READINGS).startswith("stopped")


@given(st.floats(0.1, 2.0), st.floats(-1.0, 1.0), st.floats(1.0, 1.15))
def test_whatever_stands_ahead_comes_nearer_by_the_counted_way_or_less(speed: float, cos: float, missed: float) -> None:
    bench = driving()
    readings = min(20, int(4.5 / (speed * TICKS_BETWEEN_READINGS / 80)) + 1)
    assert approach(bench, closing_mps=speed * cos, counted_mps=speed / missed, readings=readings) == "0"


@pytest.mark.parametrize("jump_m", [-0.39, 0.39, -2.0, 2.0])
def test_a_jump_to_another_thing_is_no_motion(jump_m: float) -> None:
    bench = driving()
    for tick in range(240):
        reading = tick // TICKS_BETWEEN_READINGS
        range_m = 5.0 - 0.008 * tick + jump_m * (reading >= 15)
        front = {"front": range_m} if tick % TICKS_BETWEEN_READINGS == 0 else {}
        bench.tick(distance=0.025 * int(0.01 * tick / 0.025), speed=0.8, **front)
    assert bench.active == "0"


def test_a_car_that_turns_hears_one_thing_after_the_other() -> None:
    bench = driving()
    bench.feed.values["steering"] = 0.88
    assert approach(bench, closing_mps=1.6, counted_mps=0.8) == "0"


def test_anybody_may_walk_towards_a_car_that_stands() -> None:
    bench = one_state(type="Stop", hold=30.0)
    assert approach(bench, closing_mps=1.4, counted_mps=0.0) == "0"


def test_a_machine_that_needs_no_hall_sensor_does_not_care() -> None:
    assert approach(one_state(type="Motor", throttle=0.3), closing_mps=1.6, counted_mps=0.8) == "0"


def test_a_new_drive_forgets_the_one_before() -> None:
    bench = driving()
    assert approach(bench, closing_mps=1.6, counted_mps=0.8).startswith("stopped")
    bench.reset()
    assert approach(bench, closing_mps=0.8, counted_mps=0.8) == "0"


@pytest.mark.parametrize(("share", "stops"), [(0.5, True), (0.95, False), (1.0, False)])
def test_a_car_that_drives_twice_its_speed_stops_before_the_end_wall(share: float, stops: bool) -> None:
    toy: Toy = corner("left", 2.0, 8.0)
    driver = Driver(load_machine("corners"))
    act = one_car(driver)

    def lying(observation: np.ndarray) -> np.ndarray:
        values = dict(zip(CORE_LAYOUT.names, observation.tolist(), strict=True))
        values["distance"] = 0.02513 * math.floor(values["distance"] / 0.02513 * share)
        return act(CORE_LAYOUT.pack(values | {"speed": values["speed"] * share}, 1)[0])

    toy.drive(lying, 8.0)
    assert driver.active_path.startswith("stopped: what is ahead came") == stops
    if stops:
        assert toy.x < 7.0
        assert toy.speed < 0.1
