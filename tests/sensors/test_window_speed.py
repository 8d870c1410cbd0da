"""The speed of a hall sensor that tells a distance and no edges."""

from __future__ import annotations

import pytest

from tral_env.sensors.hall import WINDOW_S, WindowSpeed


def driven(speed: float, seconds: float, max_speed: float = 10.0) -> WindowSpeed:
    """A distance each 20 ms, from a standstill at 0."""
    law = WindowSpeed(max_speed)
    for tick in range(round(seconds / 0.02) + 1):
        law.take(speed * tick * 0.02, tick * 0.02)
    return law


def test_before_two_distances_it_stands() -> None:
    assert WindowSpeed(10.0).speed(5.0) == 0.0
    assert driven(1.0, 0.0).speed(5.0) == 0.0


def test_a_steady_car_has_its_speed_and_one_that_tells_nothing_more_falls() -> None:
    law = driven(1.0, 1.0)
    assert law.speed(1.0) == pytest.approx(1.0)
    assert law.speed(1.0 + 10 * WINDOW_S) < 0.15


def test_a_first_step_does_not_look_like_a_leap_and_no_speed_is_above_the_largest() -> None:
    assert driven(1.0, 0.02).speed(0.02) == pytest.approx(0.02 / WINDOW_S)
    assert driven(9.0, 1.0, max_speed=3.0).speed(1.0) == 3.0
