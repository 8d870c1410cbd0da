"""The wheel that the hall sensor counts: travel, direction, and the sign of a wrong radius."""

import numpy as np
import pytest
from one_car import ROW, drive, one_car

from tral_env.config import HallConfig
from tral_env.simulation.sim import Simulation

TICK_M = HallConfig().metres_per_tick


def driven(throttle: float = 0.3, **car: float) -> Simulation:
    sim = one_car(**car)
    drive(sim, 0.0, throttle, 160)
    return sim


def test_the_distance_is_the_way_that_the_car_went() -> None:
    sim = driven()
    way = sim.pose[0, 0] - sim.plan(0).start[0]
    assert way > 0.5
    assert sim.hall_wheel.readings()["distance"] == pytest.approx(way, abs=2 * TICK_M)
    assert sim.hall_wheel.readings()["speed"] == pytest.approx(sim.truth.speed[0], rel=0.05)


@pytest.mark.parametrize("scale", [0.8, 1.25])
def test_a_wheel_larger_than_the_one_relied_on_makes_the_distance_short(scale: float) -> None:
    true, told = (driven(wheel_radius_scale=each).hall_wheel.readings()["distance"] for each in (1.0, scale))
    assert told == pytest.approx(true / scale, abs=2 * TICK_M)


def test_missed_ticks_are_missing_and_doubled_ones_count_twice() -> None:
    true, none, twice = (
        driven(**car).hall_wheel.readings()["distance"]
        for car in ({}, {"hall_miss_rate": 1.0}, {"hall_double_rate": 1.0})
    )
    assert (none, twice) == (0.0, pytest.approx(2 * true))


def test_a_reset_counts_from_where_the_wheel_stands() -> None:
    sim = driven()
    sim.hall_wheel.reset(ROW)
    sim.hall_wheel.update(ROW)
    assert sim.hall_wheel.readings() == {"distance": 0.0, "speed": 0.0}


def test_a_row_that_does_not_move_draws_no_noise() -> None:
    one, other = driven(hall_miss_rate=0.5), driven(hall_miss_rate=0.5)
    other.hall_wheel.update(np.zeros(0, np.int64))
    for sim in (one, other):
        drive(sim, 0.0, 0.3, 80)
    assert one.hall_wheel.readings()["distance"] == other.hall_wheel.readings()["distance"]
