"""From commands to the wheels of the model."""

import numpy as np
import pytest
from one_car import drive, one_car


def test_a_command_beyond_the_bounds_is_applied_as_the_bound() -> None:
    sim = one_car()
    drive(sim, 3.0, -2.0, 1)
    assert sim.actuators.command[0].tolist() == [1.0, -1.0]


def test_full_left_turns_the_servo_to_full_lock() -> None:
    sim = one_car()
    drive(sim, 1.0, 0.0, 80)
    assert sim.physics.ctrl[0, sim.physics.handles.steer_actuator] == pytest.approx(sim.car.full_lock)


def test_throttle_within_the_dead_zone_leaves_the_motor_off() -> None:
    sim = one_car()
    drive(sim, 0.0, 0.08, 80)
    assert sim.physics.ctrl[0, sim.physics.handles.drive_actuator] == pytest.approx(0.0, abs=1e-6)
    assert sim.truth.speed[0] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("latency_s", [0.0, 0.1])
def test_a_command_reaches_the_motor_after_the_latency(latency_s: float) -> None:
    sim = one_car(latency_s=latency_s)
    volts = []
    for _ in range(20):
        drive(sim, 0.0, 1.0, 1)
        volts.append(float(sim.physics.ctrl[0, sim.physics.handles.drive_actuator]))
    assert int(np.argmax(np.array(volts) > 1.0)) == round(latency_s * 80)


def test_a_reset_stands_still() -> None:
    sim = one_car()
    drive(sim, 0.5, 0.5, 40)
    sim.actuators.reset(np.zeros(1, np.int64))
    assert sim.actuators.command[0].tolist() == [0.0, 0.0]
