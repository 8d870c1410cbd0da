"""The ultrasonics between two walls: what they range, when, and how old it is."""

import numpy as np
import pytest
from one_car import WIDTH, drive, one_car, put

from tral_env.course.layout import Course, Segment
from tral_env.geometry import SIDE_SONAR_Y_M
from tral_env.interface import CONTROL_PERIOD_S, NO_ECHO_M

SIDE_M = WIDTH / 2 - SIDE_SONAR_Y_M
"""From a side ultrasonic to its wall, for a car in the middle."""


def test_the_first_ranges_are_those_to_the_walls() -> None:
    readings = one_car().sonars.readings()
    assert readings["ultrasonic_left"] == pytest.approx(SIDE_M, abs=0.02)
    assert readings["ultrasonic_right"] == pytest.approx(SIDE_M, abs=0.02)
    assert readings["ultrasonic_front"] == NO_ECHO_M


def test_nearer_to_the_left_wall_the_left_range_is_shorter() -> None:
    sim = one_car()
    put(sim, 3.0, 0.4)
    drive(sim, 0.0, 0.0, 20)
    readings = sim.sonars.readings()
    assert readings["ultrasonic_left"] == pytest.approx(SIDE_M - 0.4, abs=0.02)
    assert readings["ultrasonic_right"] == pytest.approx(SIDE_M + 0.4, abs=0.02)


def test_a_wall_that_is_met_askew_gives_no_echo() -> None:
    sim = one_car()
    put(sim, 3.0, 0.0, np.radians(30))
    drive(sim, 0.0, 0.0, 20)
    assert sim.sonars.readings()["ultrasonic_left"] == NO_ECHO_M


@pytest.mark.parametrize("cadence_s", [0.065, 0.11])
def test_a_range_is_published_when_its_sonar_fires_again(cadence_s: float) -> None:
    sim = one_car(sonar_cadence_s=cadence_s)
    ages = []
    for _ in range(80):
        drive(sim, 0.0, 0.0, 1)
        ages.append(float(sim.sonars.readings()["ultrasonic_left_age"]))
    settled = np.array(ages[20:])
    assert settled.min() == pytest.approx(cadence_s, abs=CONTROL_PERIOD_S)
    assert settled.max() == pytest.approx(2 * cadence_s, abs=CONTROL_PERIOD_S)
    assert (np.diff(settled) < 0).sum() == pytest.approx(60 * CONTROL_PERIOD_S / cadence_s, abs=1)


@pytest.mark.parametrize(("together", "same"), [(0.0, False), (1.0, True)])
def test_the_sonars_fire_in_turn_or_together(together: float, same: bool) -> None:
    sim = one_car(sonar_together=together)
    drive(sim, 0.0, 0.0, 40)
    readings = sim.sonars.readings()
    ages = {float(readings[f"ultrasonic_{side}_age"]) for side in ("left", "front", "right")}
    assert (len({round(age, 6) for age in ages}) == 1) == same


def test_the_end_of_the_corridor_is_ahead() -> None:
    sim = one_car(Course(name="short", segments=(Segment(length=5.0, width=WIDTH),)))
    ahead = 5.0 - sim.pose[0, 0] - sim.car.front_x
    assert sim.sonars.readings()["ultrasonic_front"] == pytest.approx(ahead, abs=0.05)
