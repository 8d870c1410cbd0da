"""The car's measures: laws on them, and that they agree with the model and with each other."""

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env import geometry
from tral_env.actuation import scrub_torque
from tral_env.assets import asset_path
from tral_env.config import CarConfig, ServoConfig


def servo_saver_stiffness() -> float:
    """N m for a radian between the servo's horn and the wheels, from the car's file."""
    (servo,) = ElementTree.parse(asset_path("car.xml")).iterfind("actuator/position[@name='steer']")
    return float(servo.attrib["kp"])


def test_full_lock_is_a_radius_of_64_cm() -> None:
    assert 1.0 / geometry.curvature(1.0) == pytest.approx(0.64, abs=0.005)


@given(st.floats(-1.0, 1.0))
def test_the_command_for_a_curvature_undoes_the_curvature_of_a_command(steering: float) -> None:
    assert geometry.steering_for(geometry.curvature(steering)) == pytest.approx(steering, abs=1e-12)


def test_sonars_stand_where_the_configuration_has_them() -> None:
    car = CarConfig()
    assert (car.middle_x, car.front_x, car.full_lock) == (
        geometry.SIDE_SONAR_X_M,
        geometry.FRONT_SONAR_X_M,
        geometry.FULL_LOCK,
    )


def test_eight_ticks_are_a_turn_of_the_wheel() -> None:
    assert pytest.approx(2 * math.pi * geometry.WHEEL_RADIUS_M / 8, rel=1e-3) == geometry.HALL_METRES_PER_TICK


@given(st.floats(0.0, 5.0))
def test_play_of_the_steering_is_the_scrub_over_the_servo_saver(speed: float) -> None:
    servo = ServoConfig()
    torque = scrub_torque(np.array([speed]), servo.scrub_torque, servo.scrub_speed)[0]
    play = torque / servo_saver_stiffness() / geometry.FULL_LOCK
    assert geometry.steering_play(speed) == pytest.approx(play, rel=2e-3)
