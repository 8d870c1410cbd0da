"""The cameras: when they look, when that is known, and how they are mounted."""

import numpy as np
import pytest
from one_car import CORRIDOR, GATE_AHEAD, ROW, drive, one_car

from tral_env.interface import MAX_AGE_S


def test_a_gate_is_known_after_the_latency_and_as_old_as_that() -> None:
    sim = one_car(GATE_AHEAD, camera_latency_s=0.05)
    for _ in range(3):
        drive(sim, 0.0, 0.0, 1)
        assert sim.cameras.readings()["gate_id"] == -1
    drive(sim, 0.0, 0.0, 1)
    readings = sim.cameras.readings()
    assert readings["gate_id"] == 2
    assert readings["gate_age"] == pytest.approx(0.05)


def test_a_gate_is_where_it_stands() -> None:
    sim = one_car(GATE_AHEAD, camera_latency_s=0.0)
    x, y = sim.plan(0).gate_pose[0, :2] - sim.pose[0, :2]
    readings = sim.cameras.readings()
    assert readings["gate_x"] == pytest.approx(x, rel=0.05)
    assert readings["gate_y"] == pytest.approx(y, abs=0.1)


def test_without_markers_nothing_is_seen() -> None:
    sim = one_car(CORRIDOR)
    drive(sim, 0.0, 0.0, 40)
    readings = sim.cameras.readings()
    assert (readings["gate_id"], readings["gate_age"]) == (-1, MAX_AGE_S)


def test_a_new_image_comes_15_times_a_second() -> None:
    sim = one_car(GATE_AHEAD)
    ages = []
    for _ in range(160):
        drive(sim, 0.0, 0.0, 1)
        ages.append(float(sim.cameras.readings()["gate_age"]))
    assert (np.diff(ages) < 0).sum() == pytest.approx(30, abs=1)


def test_the_mounting_errors_are_roll_pitch_and_yaw_in_radians() -> None:
    sim = one_car(camera_roll_deg=1.0, camera_pitch_deg=-2.0, camera_yaw_deg=3.0)
    assert sim.cameras.mounting(ROW) == pytest.approx(np.radians([[1.0, -2.0, 3.0]]))


def test_a_reset_forgets_what_was_seen() -> None:
    sim = one_car(GATE_AHEAD)
    drive(sim, 0.0, 0.0, 10)
    assert sim.cameras.readings()["gate_id"] == 2
    sim.cameras.reset(ROW)
    assert sim.cameras.readings()["gate_id"] == -1
