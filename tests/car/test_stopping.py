"""How far the car goes on when the actuator's process stops it: the table by which `too near` is judged."""

import mujoco
import pytest
from bare_floor import DrivenCar, floor_model

from tral_env.hardware.faults.laws import STOPPING
from tral_env.speed_control import feed_forward


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return floor_model()


@pytest.mark.parametrize(("speed", "way_m"), STOPPING[1:])
def test_full_brake_for_four_tenths_of_a_second_then_none(speed: float, way_m: float, model: mujoco.MjModel) -> None:
    car = DrivenCar(model)
    car.drive(0.0, min(feed_forward(speed), 1.0), 4.0)
    assert car.wheel_speed == pytest.approx(speed, abs=0.05)
    start = car.position[0]
    car.drive(0.0, -1.0, 0.4)
    car.drive(0.0, 0.0, 6.0)
    assert car.position[0] - start == pytest.approx(way_m, abs=0.03)
