"""From a command to pulses and steps of the board: exact numbers and properties."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig import STEERING, THROTTLE

from tral_env.hardware.actuator import laws

UNIT = st.floats(-1, 1)


@pytest.mark.parametrize(("value", "result"), [(-2.0, -1.0), (-1.0, -1.0), (0.25, 0.25), (1.0, 1.0), (math.inf, 1.0)])
def test_a_value_is_brought_within_bounds(value: float, result: float) -> None:
    assert laws.clamped(value, -1.0, 1.0) == result


@pytest.mark.parametrize(
    ("command", "us"), [(-1.0, 1900.0), (-0.5, 1700.0), (-0.0, 1500.0), (0.0, 1500.0), (0.25, 1400.0), (1.0, 1100.0)]
)
def test_the_pulse_of_a_command(command: float, us: float) -> None:
    assert laws.pulse_us(command, THROTTLE) == us


def test_a_skipped_dead_zone_is_left_out_on_both_sides() -> None:
    skipping = THROTTLE._replace(skip_us=40.0)
    assert [laws.pulse_us(u, skipping) for u in (-1.0, -1e-12, 0.0, 1e-12, 1.0)] == pytest.approx(
        [1900, 1540, 1500, 1460, 1100]
    )


def test_a_limit_beats_the_pulse_of_a_command() -> None:
    narrow = THROTTLE._replace(min_us=1300.0, max_us=1600.0)
    assert [laws.pulse_us(u, narrow) for u in (-1.0, 1.0)] == [1600.0, 1300.0]


@pytest.mark.parametrize(
    ("us", "command"),
    [(2100.0, -1.0), (1900.0, -1.0), (1700.0, -0.5), (1500.0, 0.0), (1400.0, 0.25), (1100.0, 1.0), (900.0, 1.0)],
)
def test_the_command_of_a_pulse_is_never_more_than_full(us: float, command: float) -> None:
    assert laws.command_of(us, THROTTLE) == command


@given(UNIT, st.sampled_from([STEERING, THROTTLE, THROTTLE._replace(skip_us=40.0)]))
def test_a_command_comes_back_from_its_pulse(command: float, channel: laws.Channel) -> None:
    assert laws.command_of(laws.pulse_us(command, channel), channel) == pytest.approx(command, abs=1e-9)


@given(UNIT, UNIT)
def test_a_command_without_a_slew_limit_passes(wanted: float, last: float) -> None:
    assert laws.slewed(wanted, last, None, 0.01, zero_at_once=False) == wanted


@pytest.mark.parametrize(
    ("wanted", "last", "zero_at_once", "result"),
    [
        (1.0, 0.0, False, 0.25),
        (-1.0, 0.0, False, -0.25),
        (0.125, 0.0, False, 0.125),
        (0.0, 1.0, False, 0.75),
        (0.0, 1.0, True, 0.0),
        (0.0, -1.0, True, 0.0),
        (-1.0, 1.0, True, 0.0),
        (-1.0, 0.125, True, -0.125),
        (1.0, -1.0, True, 0.0),
    ],
)
def test_a_slew_limit_holds_and_never_delays_a_throttle_of_zero(
    wanted: float, last: float, zero_at_once: bool, result: float
) -> None:
    assert laws.slewed(wanted, last, 25.0, 0.01, zero_at_once=zero_at_once) == result


def test_the_divider_and_the_step_of_the_data_sheet() -> None:
    # Its example: 200 Hz with the inner clock of 25 MHz is 0x1E.
    assert laws.prescale(25e6, 5000) == 0x1E
    assert laws.prescale(25e6, 34_000) == 207
    assert laws.step_us(0x1E, 25e6) == pytest.approx(1.24)


@given(st.floats(1100, 1900), st.floats(2.0, 9.0))
def test_steps_are_near_and_within_the_limits(us: float, step: float) -> None:
    sent_us = laws.board_steps(us, THROTTLE, step) * step
    assert abs(sent_us - us) <= step
    assert THROTTLE.min_us - 1e-6 <= sent_us <= THROTTLE.max_us + 1e-6


@given(st.floats(-1e6, 1e6))
def test_steps_of_a_pulse_beyond_the_limits_are_those_of_the_limit(us: float) -> None:
    steps = laws.board_steps(us, STEERING, 4.24)
    assert 1240 <= steps * 4.24 <= 1810
