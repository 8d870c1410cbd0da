"""Machines drive a toy car: late sonars with jitter, a hall sensor that counts, a car that does not run straight."""

import math

import numpy as np
import pytest
import toy

from tral_fsm import load_machine, load_policy
from tral_fsm.runtime.driver import Driver


@pytest.mark.parametrize("trim", [0.0, 1 / 22, -1 / 22])
@pytest.mark.parametrize(("offset", "heading"), [(0.25, 0.09), (-0.25, -0.09)])
def test_wall_following_comes_to_its_clearance_and_stays(offset: float, heading: float, trim: float) -> None:
    world = toy.straight(2.0, y=offset, yaw=heading, trim=trim)
    world.drive(load_policy("wall").act, 16)
    clearance = np.array([y for _, y, _ in world.path[-320:]]) + 1.0 - 0.1
    assert np.abs(clearance - 0.6).max() < 0.02
    assert world.speed == pytest.approx(load_machine("wall").states[0].speed, abs=0.03)


@pytest.mark.parametrize("width", [1.6, 2.0, 2.6])
@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("machine", ["corridor", "office"])
def test_corners_are_driven_without_touching(machine: str, turn: str, width: float) -> None:
    world = toy.corner(turn, width)
    world.drive(load_policy(machine).act, 14)
    sign = 1.0 if turn == "left" else -1.0
    assert sign * world.y > 2.0
    assert math.degrees(world.yaw) == pytest.approx(90 * sign, abs=20)
    nose = [x + 0.329 * math.cos(yaw) + 0.1 * abs(math.sin(yaw)) for x, _, yaw in world.path]
    assert max(nose) < 4.0 - 0.05


@pytest.mark.parametrize("trim", [1 / 22, -1 / 22])
def test_a_car_that_does_not_run_straight_is_found_out(trim: float) -> None:
    world = toy.straight(2.0, y=0.1, trim=trim)
    driver = Driver(load_machine("office"))
    world.drive(toy.one_car(driver), 14)
    assert driver.estimator.steering_offset == pytest.approx(-trim, abs=0.02)
    assert abs(world.path[-1][1]) < 0.15
