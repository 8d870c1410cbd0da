"""How far the car goes on when the actuator's process stops it: the table by which `too near` is judged."""

import mujoco
import pytest
from bare_floor import DrivenCar, floor_model

from tral_env.hardware.faults.laws import ROLLING, STOPPING, stopping_m
from tral_env.speed_control import feed_forward


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return floor_model()


def stopped_m(speed: float, brake: float, model: mujoco.MjModel) -> float:
    """Way of the model from a speed, m/s, after 0.4 s of brake and then none, m."""
    car = DrivenCar(model)
    car.drive(0.0, min(feed_forward(speed), 1.0), 4.0)
    assert car.wheel_speed == pytest.approx(speed, abs=0.05)
    start = car.position[0]
    car.drive(0.0, brake, 0.4)
    car.drive(0.0, 0.0, 8.0)
    return float(car.position[0] - start)


@pytest.mark.parametrize(("speed", "way_m"), STOPPING[1:])
def test_full_brake_for_four_tenths_of_a_second_then_none(speed: float, way_m: float, model: mujoco.MjModel) -> None:
    assert stopped_m(speed, -1.0, model) == pytest.approx(way_m, abs=0.03)


@pytest.mark.parametrize(("speed", "way_m"), ROLLING[1:])
def test_neutral_alone(speed: float, way_m: float, model: mujoco.MjModel) -> None:
    assert stopped_m(speed, 0.0, model) == pytest.approx(way_m, abs=0.03)


@pytest.mark.parametrize("speed", [0.52, 1.05, 1.98])
@pytest.mark.parametrize("brake", [-0.75, -0.5, -0.25])
def test_half_a_brake_needs_no_more_way_than_the_law_counts(speed: float, brake: float, model: mujoco.MjModel) -> None:
    assert stopped_m(speed, brake, model) < stopping_m(speed, brake) + 0.03
