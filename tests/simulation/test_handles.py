"""Names become indices once, and a name that is missing is told."""

import numpy as np
import pytest
from one_car import drive, one_car, put

from tral_env.config import UltrasonicConfig
from tral_env.course.scene import Pool, build_model
from tral_env.sensors.ranging import SONARS
from tral_env.simulation.handles import CarHandles


def test_the_fans_are_those_of_the_sonars_ray_by_ray() -> None:
    physics = one_car().physics
    names = [[physics.model.sensor(int(ray)).name for ray in fan] for fan in physics.handles.rays]
    assert [fan[0] for fan in names] == [f"car/ultrasonic_{side}_00" for side in SONARS]
    assert all(len(set(fan)) == UltrasonicConfig().rays for fan in names)


def test_a_fan_s_columns_hold_distance_and_normal_of_its_rays() -> None:
    sim = one_car()
    put(sim, 3.0, 0.3)
    drive(sim, 0.0, 0.0, 20)
    fans = sim.physics.sensordata[0][sim.physics.handles.fans].reshape(3, -1, 4)
    middle = dict(zip(SONARS, fans[:, fans.shape[1] // 2], strict=True))
    assert middle["left"][0] == pytest.approx(1.0 - 0.3 - 0.1, abs=0.01)
    assert middle["right"][0] == pytest.approx(1.0 + 0.3 - 0.1, abs=0.01)
    assert middle["left"][1:] == pytest.approx([0.0, -1.0, 0.0], abs=1e-3)


def test_the_car_s_bodies_are_all_of_it_and_nothing_else() -> None:
    physics = one_car().physics
    names = {physics.model.body(int(body)).name for body in physics.handles.car_bodies}
    assert "car/car" in names
    assert all(name.startswith("car/") for name in names)
    everything = {physics.model.body(body).name for body in range(physics.model.nbody)}
    assert {name for name in everything if name.startswith("car/")} == names


def test_a_car_that_rolls_forward_turns_its_wheels_forward() -> None:
    sim = one_car()
    drive(sim, 0.0, 0.5, 80)
    handles, data = sim.physics.handles, sim.physics.sensordata[0]
    assert (data[handles.wheel_speeds] > 5.0).all()
    assert data[handles.hall_wheel] > 1.0
    assert data[handles.imu][5] == pytest.approx(9.81, abs=0.5)


def test_a_sensor_that_the_model_lacks_is_named() -> None:
    fans = UltrasonicConfig(rays=12)
    with pytest.raises(KeyError, match="ultrasonic_left_11"):
        CarHandles(build_model(Pool(1), looks=False), fans)


def test_the_tyres_are_four_geoms() -> None:
    physics = one_car().physics
    names = [physics.model.geom(int(tyre)).name for tyre in physics.handles.tyres]
    assert names == [f"car/wheel_{wheel}" for wheel in ("front_left", "front_right", "rear_left", "rear_right")]
    assert np.unique(physics.handles.tyres).size == 4
