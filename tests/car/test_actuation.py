"""From command to servo and motor: every law against numbers known by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.actuation import (
    ALL,
    BRAKE,
    DRIVE,
    WAIT,
    Actuation,
    brake_voltage,
    controller_step,
    drive_voltage,
    motor_duty,
    scrub_torque,
    servo_step,
    steering_target,
)
from tral_env.config import CarConfig, EscConfig, ServoConfig
from tral_env.errors import ConfigError

CAR, SERVO, ESC = CarConfig(), ServoConfig(), EscConfig()
TICKS_TO_SWITCH = 8  # 0.1 s at 80 Hz
LOCK = CAR.full_lock


def one_car(**parameters: float) -> Actuation:
    actuation = Actuation(1)
    for name, value in {"latency_s": 0.0, **parameters}.items():
        getattr(actuation.parameters, name)[:] = value
    actuation.reset(ALL)
    return actuation


def run(actuation: Actuation, steering: float, throttle: float, ticks: int = 1, speed: float = 0.0) -> list[float]:
    """Steering angle and voltage after so many ticks."""
    for _ in range(ticks):
        drive = actuation.apply(ALL, np.array([[steering, throttle]]), np.array([speed]))
    return [float(drive.steering_angle[0]), float(drive.voltage[0])]


def array(*values: float) -> np.ndarray:
    return np.array(values, float)


# --- steering


def test_full_command_asks_for_full_lock() -> None:
    assert run(one_car(), 1.0, 0.0, ticks=40)[0] == pytest.approx(math.radians(22.0))
    assert run(one_car(), -1.0, 0.0, ticks=40)[0] == pytest.approx(-math.radians(22.0))


def test_a_command_outside_its_range_is_clipped() -> None:
    assert run(one_car(), 7.0, 0.0, ticks=40)[0] == pytest.approx(LOCK)


def test_offset_is_the_angle_at_command_zero_from_the_first_tick_on() -> None:
    assert run(one_car(steering_offset=0.04), 0.0, 0.0)[0] == 0.04


def test_lock_scale_scales_the_lock_but_not_the_offset() -> None:
    angle = run(one_car(steering_offset=0.02, lock_scale=0.9), 1.0, 0.0, ticks=40)[0]
    assert angle == pytest.approx(0.02 + 0.9 * LOCK)


@pytest.mark.parametrize(("middle_deg", "left_deg", "right_deg"), [(0, 25, -25), (6, 31, -19), (-6, 19, -31)])
def test_the_linkage_ends_25_degrees_either_side_of_its_own_middle(
    middle_deg: float, left_deg: float, right_deg: float
) -> None:
    middle = math.radians(middle_deg)
    for command, end_deg in ((1.0, left_deg), (-1.0, right_deg)):
        actuation = one_car(mechanism_offset=middle, lock_scale=2.0)
        assert math.degrees(run(actuation, command, 0.0, ticks=60)[0]) == pytest.approx(end_deg)


def test_target_is_clipped_line() -> None:
    target = steering_target(array(-1, 0, 1), array(0.1), array(1.0), array(-0.5), array(0.5))
    np.testing.assert_allclose(target, [-0.5, 0.1, 0.5])


def test_servo_runs_at_its_speed_and_stops_on_its_target() -> None:
    actuation = one_car()
    step = SERVO.speed / 80
    assert run(actuation, 1.0, 0.0)[0] == pytest.approx(step)
    assert run(actuation, 1.0, 0.0)[0] == pytest.approx(2 * step)
    ticks = math.ceil(LOCK / step)
    assert run(actuation, 1.0, 0.0, ticks=ticks - 3)[0] < LOCK
    assert run(actuation, 1.0, 0.0)[0] == pytest.approx(LOCK)


def test_a_slower_servo_takes_longer() -> None:
    assert run(one_car(servo_speed_scale=0.5), 1.0, 0.0)[0] == pytest.approx(0.5 * SERVO.speed / 80)


def test_within_its_dead_zone_the_servo_does_not_stir() -> None:
    edge = SERVO.dead_zone_deg / CAR.full_lock_deg
    assert run(one_car(), 0.99 * edge, 0.0, ticks=10)[0] == 0.0
    assert run(one_car(), 1.01 * edge, 0.0, ticks=10)[0] == pytest.approx(1.01 * edge * LOCK)


def test_once_on_its_way_the_servo_goes_right_to_its_target() -> None:
    position, moving = array(0.0), np.array([False])
    target, step, dead_zone = array(0.105), array(0.05), 0.02
    for expected, ahead in ((0.05, True), (0.1, True), (0.105, False), (0.105, False)):
        position, moving = servo_step(position, moving, target, step, dead_zone)
        assert position[0] == pytest.approx(expected)
        assert moving[0] == ahead


def test_scrub_is_full_at_standstill_and_falls_as_the_car_rolls() -> None:
    torque = scrub_torque(array(0.0, 0.06, -0.06, 0.6), 0.1, 0.06)
    np.testing.assert_allclose(torque, [0.1, 0.1 / math.sqrt(2), 0.1 / math.sqrt(2), 0.1 / math.sqrt(101)])


@given(st.floats(-6.0, 6.0))
def test_the_scrub_of_a_car_alone_is_that_of_a_row_to_the_last_bit(speed: float) -> None:
    assert scrub_torque(speed, 0.1, 0.06) == scrub_torque(array(1.0, speed), 0.1, 0.06)[1]


def test_a_weaker_servo_feels_more_scrub() -> None:
    actuation = one_car(servo_strength_scale=0.8)
    drive = actuation.apply(ALL, np.zeros((1, 2)), np.zeros(1))
    assert drive.scrub_torque[0] == pytest.approx(SERVO.scrub_torque / 0.8)


# --- latency


@pytest.mark.parametrize("ticks", [0, 1, 2, 7])
def test_a_command_arrives_after_whole_ticks_exactly(ticks: int) -> None:
    actuation = one_car(latency_s=ticks / 80)
    arrivals = [run(actuation, 0.0, 1.0)[1] > 0 for _ in range(ticks + 2)]
    assert arrivals == [False] * ticks + [True] * 2


def test_between_ticks_the_neighbouring_commands_are_mixed() -> None:
    actuation = one_car(latency_s=1.25 / 80)
    throttles = (0.4, 0.8, 0.2, 0.0, 0.0)
    volts = [run(actuation, 0.0, throttle)[1] for throttle in throttles]
    mixed = (0.0, 0.75 * 0.4, 0.75 * 0.8 + 0.25 * 0.4, 0.75 * 0.2 + 0.25 * 0.8, 0.25 * 0.2)
    duties = motor_duty(np.array(mixed), ESC.dead_zone)
    np.testing.assert_allclose(volts, duties * ESC.battery_v, atol=1e-12)


def test_latency_holds_when_the_memory_has_gone_round() -> None:
    actuation = one_car(latency_s=ESC.max_latency_s)
    rng = np.random.default_rng(0)
    throttles = rng.uniform(0.1, 1.0, 100)
    volts = np.array([run(actuation, 0.0, throttle)[1] for throttle in throttles])
    delay = round(ESC.max_latency_s * 80)
    np.testing.assert_allclose(volts[delay:], motor_duty(throttles[:-delay], ESC.dead_zone) * ESC.battery_v)


@pytest.mark.parametrize("latency_s", [-0.01, 0.3, math.nan])
def test_a_latency_that_cannot_be_simulated_is_refused(latency_s: float) -> None:
    with pytest.raises(ConfigError, match="latency_s"):
        one_car(latency_s=latency_s)


# --- motor controller


def test_throttle_is_linear_above_the_dead_zone() -> None:
    np.testing.assert_allclose(motor_duty(array(0.0, 0.08, -0.08, 0.54, -0.54, 1.0), 0.08), [0, 0, 0, 0.5, 0.5, 1])


def test_full_throttle_gives_the_battery_to_the_motor() -> None:
    assert run(one_car(), 0.0, 1.0)[1] == pytest.approx(7.2)


def test_neutral_lets_the_motor_coast_without_current() -> None:
    assert run(one_car(), 0.0, 0.0, speed=1.0)[1] == pytest.approx(ESC.back_emf)


def test_less_throttle_than_the_speed_needs_coasts_too() -> None:
    assert run(one_car(), 0.0, 0.2, speed=2.0)[1] == pytest.approx(2 * ESC.back_emf)


def test_full_brake_shorts_the_motor_and_half_brake_half_of_the_time() -> None:
    assert run(one_car(), 0.0, -1.0, speed=1.0)[1] == 0.0
    assert run(one_car(), 0.0, -0.54, speed=1.0)[1] == pytest.approx(0.5 * ESC.back_emf)


@given(st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))
def test_braking_current_always_opposes_the_motion(throttle: float, speed: float) -> None:
    duty, back_emf = motor_duty(array(throttle), ESC.dead_zone), array(ESC.back_emf * speed)
    current = (brake_voltage(duty, back_emf) - back_emf) / ESC.motor_resistance
    assert current[0] * speed <= 0


def phases_of(throttles: list[float]) -> list[tuple[float, int]]:
    direction, phase, held = array(1.0), np.array([DRIVE]), np.array([0])
    seen = []
    for throttle in throttles:
        direction, phase, held = controller_step(
            direction, phase, held, array(throttle), ESC.dead_zone, TICKS_TO_SWITCH
        )
        seen.append((float(direction[0]), int(phase[0])))
    return seen


def test_reverse_comes_after_brake_and_neutral_of_a_tenth_of_a_second_each() -> None:
    sequence = [-0.5] * 8 + [0.0] * 8 + [-0.5] * 2
    expected = [(1.0, BRAKE)] * 8 + [(1.0, WAIT)] * 8 + [(-1.0, DRIVE)] * 2
    assert phases_of(sequence) == expected


def test_forward_after_reverse_takes_the_same_sequence() -> None:
    backwards = [-0.5] * 8 + [0.0] * 8 + [-0.5] * 3
    forwards = [0.5] * 8 + [0.0] * 8 + [0.5]
    expected = [(-1.0, BRAKE)] * 8 + [(-1.0, WAIT)] * 8 + [(1.0, DRIVE)]
    assert phases_of(backwards + forwards)[len(backwards) :] == expected


def test_too_short_a_brake_is_forgotten_in_neutral() -> None:
    seen = phases_of([-0.5] * 7 + [0.0] * 20 + [-0.5])
    assert seen[-2:] == [(1.0, DRIVE), (1.0, BRAKE)]


def test_too_short_a_neutral_brakes_again() -> None:
    assert phases_of([-0.5] * 8 + [0.0] * 7 + [-0.5])[-1] == (1.0, BRAKE)


def test_throttle_forward_ends_brake_and_wait_at_once() -> None:
    assert phases_of([-0.5] * 3 + [0.5])[-1] == (1.0, DRIVE)
    assert phases_of([-0.5] * 8 + [0.0] * 3 + [0.5])[-1] == (1.0, DRIVE)


def test_brake_alone_never_leads_to_reverse() -> None:
    assert set(phases_of([-1.0] * 400)) == {(1.0, BRAKE)}


def test_throttle_within_the_dead_zone_is_neutral_to_the_controller() -> None:
    assert phases_of([-0.5] * 8 + [-0.07] * 8 + [-0.5])[-1] == (-1.0, DRIVE)


def test_reverse_drives_with_negative_voltage() -> None:
    actuation = one_car()
    run(actuation, 0.0, -0.5, ticks=8)
    assert run(actuation, 0.0, 0.0, ticks=8)[1] == 0.0
    assert run(actuation, 0.0, -1.0)[1] == pytest.approx(-7.2)


# --- battery


def test_a_stiff_battery_holds_its_voltage() -> None:
    drive = one_car().apply(ALL, np.array([[0.0, 1.0]]), np.zeros(1))
    assert drive.battery_v[0] == 7.2


def test_a_real_battery_sags_as_the_voltage_divider_says() -> None:
    actuation = one_car(battery_v=8.0, battery_resistance=0.1)
    drive = actuation.apply(ALL, np.array([[0.0, 1.0]]), np.zeros(1))
    loaded = 8.0 * ESC.motor_resistance / (ESC.motor_resistance + 0.1)
    assert drive.voltage[0] == pytest.approx(loaded)
    assert drive.battery_v[0] == pytest.approx(loaded)


def test_at_part_throttle_the_battery_gives_only_the_duty_of_the_motor_current() -> None:
    duty, resistance = array(0.5), array(0.2)
    voltage, battery_v = drive_voltage(duty, array(1.0), array(7.2), resistance, 0.9)
    current = (voltage - 1.0) / 0.9
    np.testing.assert_allclose(battery_v, 7.2 - 0.5 * current * 0.2)
    np.testing.assert_allclose(voltage, 0.5 * battery_v)


def test_coasting_and_braking_take_nothing_from_the_battery() -> None:
    for throttle in (0.0, -1.0):
        drive = one_car(battery_resistance=0.2).apply(ALL, np.array([[0.0, throttle]]), np.ones(1))
        assert drive.battery_v[0] == 7.2


# --- rows


def random_drive(n: int, rows: slice, alone: bool) -> np.ndarray:
    """What the cars `rows` of n get over 200 ticks of random commands, with the others or alone."""
    rng = np.random.default_rng(3)
    commands, speeds = rng.uniform(-1, 1, (200, n, 2)).round(1), rng.uniform(-2, 2, (200, n))
    drawn = {"latency_s": rng.uniform(0, 0.08, n), "steering_offset": rng.uniform(-0.1, 0.1, n)}
    drawn |= {"battery_resistance": rng.uniform(0, 0.2, n), "servo_strength_scale": rng.uniform(0.6, 1.4, n)}
    chosen = rows if alone else ALL
    actuation = Actuation(len(range(n)[chosen]))
    for name, values in drawn.items():
        getattr(actuation.parameters, name)[:] = values[chosen]
    actuation.reset(ALL)
    log = []
    for command, speed in zip(commands, speeds, strict=True):
        drive = actuation.apply(ALL, command[chosen], speed[chosen])
        out = np.stack([drive.steering_angle, drive.voltage, drive.scrub_torque, drive.battery_v])
        log.append(out if alone else out[:, rows])
    return np.array(log)


@pytest.mark.parametrize("rows", [slice(0, 1), slice(4, 5), slice(6, 9)])
def test_a_row_is_the_same_bit_for_bit_alone_and_among_others(rows: slice) -> None:
    np.testing.assert_array_equal(random_drive(9, rows, alone=True), random_drive(9, rows, alone=False))


def test_cars_that_are_not_named_keep_their_state() -> None:
    apart, together = Actuation(3), Actuation(3)
    command, speed = np.array([[0.5, 0.5], [-0.5, 0.3], [0.2, -0.9]]), np.zeros(3)
    named = np.array([0, 2])
    for _ in range(10):
        apart.apply(named, command[named], speed[named])
    for _ in range(10):
        late = apart.apply(np.array([1]), command[[1]], speed[[1]])
        whole = together.apply(ALL, command, speed)
    assert late.steering_angle[0] == whole.steering_angle[1]
    assert late.voltage[0] == whole.voltage[1]


def test_reset_of_a_car_forgets_what_was_on_its_way_and_leaves_the_others() -> None:
    actuation = Actuation(2)
    command = np.tile([1.0, 1.0], (2, 1))
    for _ in range(10):
        actuation.apply(ALL, command, np.zeros(2))
    actuation.reset(np.array([0]))
    drive = actuation.apply(ALL, np.zeros((2, 2)), np.zeros(2))
    assert drive.steering_angle[0] == 0.0
    assert drive.voltage[0] == 0.0
    assert drive.steering_angle[1] == pytest.approx(LOCK)
    assert drive.voltage[1] == pytest.approx(7.2)
