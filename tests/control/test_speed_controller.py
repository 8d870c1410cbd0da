"""From a wanted speed to a throttle, with numbers that can be checked by hand."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from readings import two_states

from tral_fsm.control import speed as speed_loop


def test_feed_forward_is_the_line_through_the_level_table() -> None:
    assert [speed_loop.feed_forward(v) for v in (0.0, 0.264, 1.056)] == pytest.approx([0.0, 0.2, 0.5])


def test_speed_control_at_its_speed_is_feed_forward_alone() -> None:
    assert speed_loop.speed_control(0.528, 0.528, 0.0) == pytest.approx((0.3, 0.0))


def test_speed_control_adds_p_and_i() -> None:
    throttle, integral = speed_loop.speed_control(0.528, 0.328, 0.01)
    assert integral == pytest.approx(0.01 + 0.25 * 0.2 * 0.0125)
    assert throttle == pytest.approx(0.3 + 0.15 * 0.2 + integral)


@given(st.floats(0, 5), st.floats(0, 0.149), st.floats(-1, 1))
def test_a_standing_car_is_never_put_in_reverse(wanted: float, speed: float, integral: float) -> None:
    assert speed_loop.speed_control(wanted, speed, integral)[0] >= 0.0


@given(st.floats(0, 5), st.floats(0, 5), st.floats(-1, 1))
def test_speed_control_stays_within_the_command(wanted: float, speed: float, integral: float) -> None:
    throttle, summed = speed_loop.speed_control(wanted, speed, integral)
    assert -1 <= throttle <= 1
    assert abs(summed) <= speed_loop.SPEED_I_LIMIT


def test_a_car_that_does_not_start_gets_neutral_once_a_second() -> None:
    # after reverse gear the motor controller brakes until it has seen neutral for 100 ms
    bench = two_states({"type": "Timer", "seconds": 100}, {"type": "Motor", "speed": 0.5})
    neutral = [bench.tick(speed=0.0)[1] == 0.0 for _ in range(96)]
    assert neutral == [False] * 80 + [True] * 16
    assert bench.tick(speed=0.0)[1] > 0.0
