"""Dead reckoning."""

import math

import pytest
from readings import one_state


def test_dead_reckoning_takes_the_trim_of_the_parameters_off() -> None:
    bench = one_state(type="Motor", throttle=0.2, steering_trim=0.1)
    for _ in range(80):
        assert bench.tick(distance=0.0, speed=2.0, steering=0.1)[0] == pytest.approx(0.1)
    for k in range(200):
        bench.tick(distance=0.01 * k)
    assert abs(math.degrees(bench.estimate.yaw)) < 2.0  # 17 degrees if it were taken for a turn
    assert bench.estimate.x == pytest.approx(1.99, abs=0.01)


def test_doubt_about_turns_grows_in_reverse_too() -> None:
    bench = one_state(type="Motor", throttle=-0.2)
    doubts = []
    for k in range(100):
        bench.tick(distance=0.01 * k, speed=0.04, throttle=-0.2, steering=(-1.0) ** (k // 20))
        doubts.append(bench.estimator.odometry.lag_heading_change)
    assert bench.estimate.arc_length < 0.0
    assert doubts == sorted(doubts)
    assert doubts[-1] > 0.1
