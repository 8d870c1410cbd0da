"""The gate of commands: what is a command, how old it may be, and what it takes to drive again."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.errors import ConfigError
from tral_env.geometry import FULL_LOCK
from tral_env.ros.commands import CommandGate, CommandLimits, Received, drive_of, steering_of, throttle_of
from tral_env.ros.msg.sensor import AckermannDrive, AckermannDriveStamped
from tral_env.ros.msg.std import Header
from tral_env.ros.times import stamp

NOW_NS = 5_000_000_000


def command(speed: float = 0.5, *, age_s: float = 0.0, source: int = 1, open_loop: bool = True) -> Received:
    header = Header(stamp(NOW_NS - round(age_s * 1e9)))
    return Received(AckermannDriveStamped(header, AckermannDrive(0.1, speed=speed)), source, open_loop)


def armed(limits: CommandLimits | None = None) -> CommandGate:
    gate = CommandGate(limits)
    gate.arm(0.0)
    return gate


share = st.floats(-1.0, 1.0, width=32)


@given(share, share)
def test_steering_and_throttle_come_back_from_a_message(steering: float, throttle: float) -> None:
    drive = AckermannDrive.deserialize(drive_of(steering, throttle).serialize(use_version_2=False))
    assert steering_of(drive) == pytest.approx(steering, abs=1e-6)
    assert throttle_of(drive) == pytest.approx(throttle, abs=1e-6)
    assert drive.steering_angle == pytest.approx(steering * FULL_LOCK, abs=1e-6)


def test_nobody_drives_a_car_that_is_not_armed() -> None:
    gate = CommandGate()
    gate.hear(command(), 0.0, NOW_NS)
    assert gate.command(0.0, 0.0) is None
    assert gate.why == "not armed yet"


def test_an_armed_car_waits_in_neutral_for_its_first_command_and_not_for_ever() -> None:
    gate = armed()
    assert gate.command(0.0, 1.9) == (0.0, 0.0)
    assert gate.command(0.0, 2.1) is None
    assert gate.why == "no command for 2 s after arming"


def test_an_open_loop_command_is_a_throttle() -> None:
    gate = armed()
    gate.hear(command(2.64), 0.0, NOW_NS)
    assert gate.command(0.0, 0.1) == pytest.approx((0.1 / FULL_LOCK, 1.0), abs=1e-6)


def test_a_speed_is_regulated() -> None:
    gate = armed()
    gate.hear(command(1.0, open_loop=False), 0.0, NOW_NS)
    standing, fast = gate.command(0.0, 0.0), gate.command(2.0, 0.0)
    assert standing is not None
    assert fast is not None
    assert standing[1] > 0.4 > fast[1]


def test_a_car_without_commands_stops_and_a_new_command_does_not_start_it() -> None:
    gate = armed()
    gate.hear(command(), 0.0, NOW_NS)
    assert gate.command(0.5, 0.15) is not None
    assert gate.command(0.5, 0.16) is None
    assert gate.why == "no command for 0.15 s"
    gate.hear(command(), 0.17, NOW_NS)
    assert gate.command(0.5, 0.17) is None
    gate.arm(1.0)
    assert gate.command(0.5, 1.0) == (0.0, 0.0)


def test_an_old_command_is_no_command() -> None:
    gate = armed()
    gate.hear(command(age_s=0.2), 0.0, NOW_NS)
    assert gate.late == 1
    assert gate.command(0.0, 0.0) == (0.0, 0.0)
    gate.hear(command(age_s=0.1), 0.0, NOW_NS)
    assert gate.command(0.0, 0.0) != (0.0, 0.0)


def test_a_stamp_of_zero_means_now() -> None:
    gate = armed()
    gate.hear(command(age_s=NOW_NS / 1e9), 0.0, NOW_NS)
    assert gate.late == 0
    assert gate.command(0.0, 0.0) != (0.0, 0.0)


def test_two_publishers_stop_the_car() -> None:
    gate = armed()
    gate.hear(command(), 0.0, NOW_NS)
    gate.hear(command(source=2), 0.0, NOW_NS)
    assert gate.command(0.0, 0.0) is None
    assert gate.why.startswith("two publishers")


@pytest.mark.parametrize("speed", [math.nan, math.inf])
def test_a_command_that_is_no_number_stops_the_car(speed: float) -> None:
    gate = armed()
    gate.hear(command(speed), 0.0, NOW_NS)
    assert gate.command(0.0, 0.0) is None


@pytest.mark.parametrize("seconds", [0.0, -1.0, 11.0])
def test_a_time_that_is_none_is_refused(seconds: float) -> None:
    with pytest.raises(ConfigError, match="timeout_s"):
        CommandLimits(timeout_s=seconds)


def test_a_command_of_a_clock_that_is_ahead_is_no_command() -> None:
    gate = armed()
    gate.hear(command(age_s=-5.0), 0.0, NOW_NS)
    assert (gate.late, gate.refused) == (0, 1)
    assert gate.command(0.0, 0.0) == (0.0, 0.0)


def test_a_command_without_a_stamp_answers_what_was_told_until_it_came() -> None:
    gate = armed()
    gate.hear(command(age_s=NOW_NS / 1e9), 0.0, NOW_NS)
    assert gate.answers_ns == NOW_NS


def test_who_sends_by_a_wrong_clock_is_told_so() -> None:
    gate = armed()
    gate.hear(command(age_s=3.0), 0.0, NOW_NS)
    assert gate.command(0.0, 2.1) is None
    assert gate.why == "no command for 2 s after arming; 1 came with stamps over 0.15 s off: compare both clocks"


def test_a_speed_is_not_regulated_where_no_hall_sensor_tells_it() -> None:
    gate = armed()
    gate.hear(command(1.0, open_loop=False), 1.9, NOW_NS)
    assert gate.command(None, 1.95) == (pytest.approx(0.1 / FULL_LOCK), 0.0)
    gate.hear(command(1.0, open_loop=False), 2.0, NOW_NS)
    assert gate.command(None, 2.01) is None
    assert gate.why.endswith("no hall sensor tells the car's: send ackermann_cmd_open_loop")


def test_a_throttle_needs_no_hall_sensor() -> None:
    gate = armed()
    gate.hear(command(2.64), 3.0, NOW_NS)
    assert gate.command(None, 3.1) == pytest.approx((0.1 / FULL_LOCK, 1.0), abs=1e-6)


def test_what_was_answered_before_an_arming_answers_nothing_after_it() -> None:
    gate = armed()
    gate.hear(command(), 0.0, NOW_NS)
    assert gate.answers_ns == NOW_NS
    gate.arm(1.0)
    assert gate.answers_ns == 0
