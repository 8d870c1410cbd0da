"""What is drawn for a car reaches its model and its actuators."""

import numpy as np
import pytest
from one_car import one_car


def test_every_body_of_the_car_is_heavier_by_the_scale() -> None:
    plain, heavy = one_car().physics, one_car(mass_scale=1.2).physics
    bodies = plain.handles.car_bodies
    assert plain.mass[0, bodies].sum() == pytest.approx(1.9, abs=0.01)
    np.testing.assert_allclose(heavy.mass[0, bodies], 1.2 * plain.mass[0, bodies])
    np.testing.assert_allclose(heavy.inertia[0, bodies], 1.2 * plain.inertia[0, bodies])


def test_the_tyres_have_the_friction_and_the_sonars_the_cadence() -> None:
    physics = one_car(friction=0.55, sonar_cadence_s=0.1).physics
    assert np.all(physics.geom["geom_friction"][0, physics.handles.tyres, 0] == 0.55)
    assert np.all(physics.sensor_interval[0, physics.handles.rays.ravel(), 0] == 0.1)


@pytest.mark.parametrize(
    ("name", "drawn", "of_the_actuation", "value"),
    [
        ("mechanism_offset_deg", 6.0, "mechanism_offset", np.radians(6.0)),
        ("steering_offset_deg", -1.0, "steering_offset", np.radians(-1.0)),
        ("lock_scale", 0.9, "lock_scale", 0.9),
        ("servo_speed_scale", 0.7, "servo_speed_scale", 0.7),
        ("servo_strength_scale", 0.8, "servo_strength_scale", 0.8),
        ("latency_s", 0.05, "latency_s", 0.05),
        ("battery_v", 8.0, "battery_v", 8.0),
        ("battery_resistance_ohm", 0.1, "battery_resistance", 0.1),
    ],
)
def test_the_actuators_get_what_was_drawn(name: str, drawn: float, of_the_actuation: str, value: float) -> None:
    sim = one_car(**{name: drawn})
    assert getattr(sim.actuators.actuation.parameters, of_the_actuation).tolist() == [value]


def test_what_was_drawn_is_told() -> None:
    assert one_car(friction=0.55).car_parameters.drawn["friction"].tolist() == [0.55]
