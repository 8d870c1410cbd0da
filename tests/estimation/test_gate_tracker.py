"""Gates are tracked over their detections, and teach the car its trim and steering gain."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_env.geometry import curvature, steering_play
from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT
from tral_env.se2 import clip
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.estimator import Estimator
from tral_fsm.estimation.gate_tracker import GateTracker
from tral_fsm.estimation.odometry import OdometrySample

GATE = (6.0, 0.3, 0.1)
"""x, y [m], heading of its axis [rad]."""
FRAME_TICKS = 5


class Approach:
    """A kinematic car with a faulty steering that drives estimator and camera; the gate is seen from 1.4 m on."""

    def __init__(self, trim: float = 0.0, lock: float = 1.0, *, seed: int = 0, speed: float = 0.5) -> None:
        self.trim, self.lock, self.speed = trim, lock, speed
        self.estimator, self.estimate = Estimator(), CarEstimate()
        self.x = self.y = self.yaw = self.distance = 0.0
        self.wheels = 0.0
        self.rng = np.random.default_rng(seed)
        self.seen = (-1.0, 0.0, 0.0, 0.0, 10.0)
        self.tick = 0

    def gate_from_here(self) -> tuple[float, float, float]:
        """Where the gate truly is."""
        dx, dy = GATE[0] - self.x, GATE[1] - self.y
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return cos * dx + sin * dy, cos * dy - sin * dx, GATE[2] - self.yaw

    def gate_as_known(self) -> tuple[float, float, float]:
        """Where the estimator takes it to be."""
        return self.estimate.seen_from_here(self.estimate.gate)

    def drive(self, steering: float, metres: float, *, look: bool = True) -> None:
        """Drive with a steering command; the wheels follow it as dead reckoning has it."""
        for _ in range(round(metres / self.speed / CONTROL_PERIOD_S)):
            behind = steering - self.wheels
            behind -= clip(behind, steering_play(self.speed))
            self.wheels += behind * CONTROL_PERIOD_S / 0.06
            step = self.speed * CONTROL_PERIOD_S
            bend = self.lock * curvature(self.wheels - self.trim)
            middle = self.yaw + step * bend / 2
            self.x += step * math.cos(middle)
            self.y += step * math.sin(middle)
            self.yaw += step * bend
            self.distance += step * (1.0 - bend * 0.155 / 2)
            self.tick += 1
            self.seen = (*self.seen[:4], self.seen[4] + CONTROL_PERIOD_S)
            x, y, heading = self.gate_from_here()
            if look and self.tick % FRAME_TICKS == 0 and x > 1.4:
                noise = self.rng.normal(size=3) * (0.003 * x, 0.002 * x, 0.003 + 0.001 * x * x)
                self.seen = (0.0, x + noise[0], y + noise[1], heading + noise[2], 0.0)
            self.update(steering)

    def update(self, steering: float) -> None:
        readings = dict.fromkeys(CORE_LAYOUT.names, 0.0) | {
            "distance": self.distance,
            "speed": self.speed,
            "steering": steering,
            "throttle": 0.3,
            "marker_id": -1.0,
            "marker_age": 10.0,
        }
        for side in ("left", "front", "right"):
            readings |= {f"ultrasonic_{side}": 6.0, f"ultrasonic_{side}_age": 10.0}
        names = ("gate_id", "gate_x", "gate_y", "gate_heading", "gate_age")
        self.estimate = self.estimator.update(list((readings | dict(zip(names, self.seen, strict=True))).values()))


@pytest.mark.parametrize("trim", [-0.1, 0.05, 0.1])
def test_a_metre_and_a_half_towards_a_gate_teaches_the_trim(trim: float) -> None:
    car = Approach(trim)
    car.drive(trim / 2, 1.5)
    assert car.estimator.steering_offset == pytest.approx(trim, abs=0.02)


def test_a_car_without_faults_learns_none() -> None:
    car = Approach()
    car.drive(0.0, 2.0)
    assert abs(car.estimator.steering_offset) < 0.01
    assert car.estimator.steering_gain == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("lock", [0.88, 1.12])
def test_turning_to_both_sides_tells_the_lock_from_the_trim(lock: float) -> None:
    car = Approach(0.03, lock)
    for steering in (0.5, -0.5, 0.5, -0.5):
        car.drive(steering, 0.6)
    assert car.estimator.steering_gain == pytest.approx(lock, abs=0.04)
    assert car.estimator.steering_offset == pytest.approx(0.03, abs=0.02)


@pytest.mark.parametrize("trim", [-0.1, 0.1])
def test_a_gate_out_of_view_is_known_to_three_centimetres_over_a_metre_and_a_half(trim: float) -> None:
    car = Approach(trim)
    car.drive(trim, 2.5)
    car.drive(trim, 1.5, look=False)
    assert car.gate_as_known()[:2] == pytest.approx(car.gate_from_here()[:2], abs=0.03)
    assert car.gate_as_known()[2] == pytest.approx(car.gate_from_here()[2], abs=math.radians(2))


def test_sightings_together_are_better_than_the_last_one() -> None:
    errors = []
    for seed in range(20):
        car = Approach(seed=seed)
        car.drive(0.0, 3.0)
        errors.append((car.gate_as_known()[1] - car.gate_from_here()[1], car.seen[2] - car.gate_from_here()[1]))
    filtered, last = np.sqrt(np.mean(np.square(errors), axis=0))
    assert filtered < 0.7 * last


START = OdometrySample(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def fresh() -> GateTracker:
    return GateTracker(4.0, 0.0, 0.0, START)


def test_one_sighting_far_off_is_not_believed_three_are() -> None:
    track = fresh()
    for _ in range(5):
        track.update(4.0, 0.0, 0.0, START)
    for believed in (False, False, True):
        assert track.update(4.0, 1.5, 0.0, START) == (0.0, 0.0)
        assert (track.y == 1.5) is believed


sighting = st.tuples(
    st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-0.1, 0.1), st.floats(0.0, 0.3), st.floats(-0.3, 0.3)
)


@settings(deadline=None)
@given(st.lists(sighting, max_size=30))
def test_the_covariance_stays_one(sightings: list[tuple[float, float, float, float, float]]) -> None:
    track, path, yaw = fresh(), 0.0, 0.0
    for x, y, heading, driven, turned in sightings:
        path, yaw = path + driven, yaw + turned
        track.update(4.0 + x, y, heading, OdometrySample(path, 0.0, yaw, path, 0.0, 0.0))
    assert np.allclose(track.P, np.transpose(track.P), atol=1e-9)
    assert np.linalg.eigvalsh(track.P).min() > -1e-9
