"""From a wanted speed to a throttle, with numbers that can be checked by hand."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from readings import two_states

from tral_env import speed_control as speed_loop
from tral_fsm.control.command import IDLE, Command, is_command
from tral_fsm.control.speed import SpeedController


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


@given(st.floats(0, 5), st.floats(-1, 1))
def test_a_speed_of_zero_never_drives(speed: float, integral: float) -> None:
    assert speed_loop.speed_control(0.0, speed, integral)[0] <= 0.0


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


class TestWhatACommandAsksFor:
    def test_a_throttle_alone_is_the_open_loop(self) -> None:
        controller = SpeedController()
        assert [controller.throttle(Command(throttle=0.25), 0.0) for _ in range(200)] == [0.25] * 200

    def test_with_a_speed_beside_it_the_throttle_is_applied_as_it_is(self) -> None:
        controller = SpeedController()
        assert [controller.throttle(Command(speed=0.0, throttle=-0.3), 0.0) for _ in range(200)] == [-0.3] * 200

    def test_with_neither_the_car_rolls_in_neutral(self) -> None:
        assert SpeedController().throttle(IDLE, 1.0) == 0.0

    def test_a_speed_of_zero_leaves_a_standing_car_in_neutral(self) -> None:
        assert SpeedController().throttle(Command(speed=0.0), 0.0) == 0.0

    def test_a_speed_of_zero_drives_no_car_on_after_a_hard_cruise(self) -> None:
        # 400 ticks uphill at 0.6 instead of 1 m/s bring the integral to its limit
        controller = SpeedController()
        for _ in range(400):
            controller.throttle(Command(speed=1.0), 0.6)
        assert controller.throttle(Command(speed=1.0), 1.0) == pytest.approx(0.1 + 1.0 / 2.64 + 0.25)
        assert [controller.throttle(Command(speed=0.0), v) for v in (0.3, 0.1, 0.0)] == [0.0, 0.0, 0.0]

    def test_a_car_that_has_stood_at_a_speed_of_zero_starts_like_the_first_time(self) -> None:
        controller, fresh = SpeedController(), SpeedController()
        for _ in range(400):
            controller.throttle(Command(speed=1.0), 0.6)
        controller.throttle(Command(speed=0.0), 0.0)
        assert controller.throttle(Command(speed=1.0), 0.0) == fresh.throttle(Command(speed=1.0), 0.0)


class TestStallRelease:
    """A car that stands for 80 ticks although it should drive gets 16 ticks of neutral, then a new start."""

    # 0.1 + 0.528 / 2.64 + 0.15 x 0.528 = 0.3792; each tick of standing adds 0.25 x 0.528 x 0.0125 = 0.00165
    AT_ONCE, A_TICK = 0.3792, 0.00165

    def throttles(self, command: Command, speeds: list[float]) -> list[float]:
        controller = SpeedController()
        return [controller.throttle(command, speed) for speed in speeds]

    def test_a_regulated_speed(self) -> None:
        got = self.throttles(Command(speed=0.528), [0.0] * 98)
        assert got[:80] == pytest.approx([self.AT_ONCE + self.A_TICK * (k + 1) for k in range(80)])
        assert got[79] == pytest.approx(0.5112)
        assert got[80:96] == [0.0] * 16
        assert got[96:] == pytest.approx([self.AT_ONCE + self.A_TICK, self.AT_ONCE + 2 * self.A_TICK])

    def test_reverse_in_the_open_loop(self) -> None:
        assert self.throttles(Command(throttle=-0.3), [0.0] * 193) == ([-0.3] * 80 + [0.0] * 16) * 2 + [-0.3]

    @pytest.mark.parametrize(("moved", "released"), [(0.0499, True), (0.05, False)])
    def test_one_tick_in_which_the_car_moves_begins_the_count_anew(self, moved: float, released: bool) -> None:
        got = self.throttles(Command(throttle=-0.3), [0.0] * 79 + [moved] + [0.0])
        assert (got[80] == 0.0) is released

    @pytest.mark.parametrize("between", [Command(speed=0.0, throttle=0.0), Command(throttle=0.2), IDLE])
    def test_a_start_after_a_stop_is_like_the_first_start(self, between: Command) -> None:
        controller, fresh = SpeedController(), SpeedController()
        for _ in range(80):
            controller.throttle(Command(speed=0.528), 0.0)
        for _ in range(800):
            controller.throttle(between, 0.0)
        again, first = ([each.throttle(Command(speed=0.528), 0.0) for _ in range(98)] for each in (controller, fresh))
        assert again == first
        assert again[0] > 0.0

    def test_backing_up_forgets_the_integral_too(self) -> None:
        controller = SpeedController()
        for _ in range(40):
            controller.throttle(Command(speed=0.528), 0.0)
        controller.throttle(Command(throttle=-0.3), 0.3)
        assert controller.throttle(Command(speed=0.528), 0.0) == pytest.approx(self.AT_ONCE + self.A_TICK)


@pytest.mark.parametrize(
    "command",
    [
        Command(0.0, speed=-0.5),
        Command(0.0, speed=50.0),
        Command(0.0, speed=True),
        Command(0.0, throttle=1.5),
        Command(0.0, throttle=-7.0),
    ],
)
def test_a_speed_or_throttle_that_no_car_has_is_no_command(command: Command) -> None:
    assert not is_command(command)


def test_the_fastest_speed_and_full_throttle_are_commands() -> None:
    assert is_command(Command(0.0, speed=5.0))
    assert is_command(Command(0.0, throttle=-1.0))
