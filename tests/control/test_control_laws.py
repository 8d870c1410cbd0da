"""The equations, with numbers that can be checked by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.config import CarConfig
from tral_env.geometry import FULL_LOCK, TRACK_M, WHEELBASE_M, curvature
from tral_env.interface import CONTROL_PERIOD_S, CONTROL_RATE_HZ
from tral_env.se2 import wrap
from tral_fsm.control import laws as control

angles = st.floats(-100, 100)


steerings = st.floats(-1, 1)


def test_the_tick_is_that_of_2016() -> None:
    assert (control.PID_S, control.PID_INVS) == (0.0125, 80.0) == (CONTROL_PERIOD_S, CONTROL_RATE_HZ)


def test_the_law_of_2016_adds_its_three_parts() -> None:
    # 2 * 0.1 + 4 * 0.3 * 0.0125 + 0.5 * (0.1 - 0.09) * 80
    assert control.pid(2, 4, 0.5, 0.1, 0.3, 0.09) == pytest.approx(0.2 + 0.015 + 0.4)


def test_the_printed_gains_saturate_at_8_cm_and_at_one_step_of_jitter() -> None:
    assert control.pid(12, 0, 0, 1 / 12, 0, 0) == pytest.approx(1.0)
    assert control.pid(0, 0, 30, 0.00865, 0, 0.0) == pytest.approx(20.76)


def test_the_derivative_over_the_sonars_interval_is_a_rate() -> None:
    assert control.pid_rate(2, 4, 0.5, 0.1, 0.3, -0.2) == pytest.approx(0.2 + 0.015 - 0.1)


def test_the_ramp_is_linear_and_stays_at_its_end() -> None:
    assert [control.ramp(0.8, 0.4, 2.0, s) for s in (0.0, 0.5, 2.0, 9.0)] == pytest.approx([0.8, 0.7, 0.4, 0.4])


def test_geometry_is_that_of_the_car() -> None:
    car = CarConfig()
    assert (car.wheelbase, car.track) == (WHEELBASE_M, TRACK_M)
    assert pytest.approx(car.full_lock) == FULL_LOCK


def test_full_lock_turns_on_a_radius_of_64_cm() -> None:
    assert 1 / curvature(1.0) == pytest.approx(0.6386, abs=1e-4)


@given(steerings)
def test_steering_and_curvature_are_inverse(steering: float) -> None:
    assert control.clipped_steering_for(curvature(steering)) == pytest.approx(steering, abs=1e-12)


@given(st.floats(-10, 10), st.floats(0.1, 10))
def test_clip_keeps_within_its_limit(value: float, limit: float) -> None:
    clipped = control.clip(value, limit)
    assert -limit <= clipped <= limit
    assert clipped == value or abs(value) > limit


@given(angles)
def test_wrapped_angles_point_the_same_way(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


def test_pursuit_of_a_point_straight_ahead_goes_straight() -> None:
    assert control.pursuit(1.0, 0.0) == 0.0


def test_pursuit_drives_the_circle_through_the_point() -> None:
    # a quarter circle of radius 1 m ends at (1, 1)
    assert curvature(control.pursuit(1.0, 1.0)) == pytest.approx(1.0)


def test_line_steers_back_to_the_line_and_not_at_all_on_it() -> None:
    assert control.line(0.0, 0.0, 0.5) == 0.0
    assert curvature(control.line(0.1, 0.0, 0.5)) == pytest.approx(-0.1 / 0.25)
    assert curvature(control.line(0.0, 0.1, 0.5)) == pytest.approx(-4 * math.sin(0.1))


def test_line_is_approached_at_45_degrees_at_most() -> None:
    assert control.line(50.0, -math.pi / 4, 0.5) == pytest.approx(0.0, abs=1e-12)


def test_a_car_slows_linearly_before_something_ahead() -> None:
    assert control.slowed(0.8, 0.3, 2.0, 2.5) is None
    assert control.slowed(0.8, 0.3, 2.0, 1.5) == pytest.approx(0.55)
    assert control.slowed(0.8, 0.3, 2.0, 1.0) == pytest.approx(0.3)
    assert control.slowed(0.8, 0.3, 2.0, 0.2) == pytest.approx(0.3)
    assert control.slowed(0.2, 0.3, 2.0, 0.2) == pytest.approx(0.2)
    assert control.slowed(None, 0.3, 2.0, 0.2) is None
    assert control.slowed(0.8, 0.3, None, 0.2) is None


def test_on_a_line_that_slopes_the_car_drives_at_its_slope() -> None:
    on_it = control.curvature_onto(0.0, math.asin(0.1), 0.4, slope=0.1)
    assert on_it == pytest.approx(0.0, abs=1e-12)
    assert control.curvature_onto(0.0, 0.0, 0.4, slope=0.1) == pytest.approx(2.0 / 0.4 * 0.1)
    assert control.curvature_onto(0.0, 0.0, 0.4, steepest=math.asin(0.05), slope=0.1) == pytest.approx(2.0 / 0.4 * 0.05)
