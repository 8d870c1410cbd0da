"""What stops a drive or warns: each law with the smallest drive that it must notice, and one that it must not."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.errors import ConfigError
from tral_env.hardware.car_file import BatteryLimits
from tral_env.hardware.faults import FAULTS, Decision, FaultLimits, FaultWatch, Finding, Look
from tral_env.hardware.faults.laws import ROLLING, STOPPING, stopping_m
from tral_env.interface import CONTROL_PERIOD_S, CORE_FIELDS, NO_ECHO_M
from tral_env.speed_control import THROTTLE_DEAD
from tral_fsm.control.speed import MOVING_MPS
from tral_fsm.runtime.watch import MAX_SILENCE_S

ALL = frozenset(field.name for field in CORE_FIELDS) | {"battery"}
HALL = frozenset({"distance", "speed"})
SONAR = frozenset({"ultrasonic_front", "ultrasonic_front_age"})


def drive(
    watch: FaultWatch,
    seconds: float,
    readings: Callable[[float], Mapping[str, float]],
    throttle: float = 0.3,
    **more: Any,
) -> float | None:
    """Look at the car in each tick; the time at which it was stopped, s."""
    for tick in range(1, round(seconds / CONTROL_PERIOD_S) + 1):
        now = tick * CONTROL_PERIOD_S
        rest = {name: value(now) for name, value in more.items()}
        if watch.update(Look(now, readings(now), throttle, **rest)):
            return now
    return None


def rolling(speed: float) -> Callable[[float], dict[str, float]]:
    """Readings of the hall sensor of a car that rolls on, in ticks of 2.5 cm."""
    return lambda now: {"distance": speed * now // 0.025 * 0.025, "speed": speed}


def standing(_: float) -> dict[str, float]:
    return {"distance": 0.0, "speed": 0.0}


def sonar(
    metres: Callable[[float], float], side: str = "front", speed: float = 1.0, dies_at_s: float = 1e9
) -> Callable[[float], dict[str, float]]:
    """Readings of a car that rolls on, with one ultrasonic that fires ten times a second until it dies."""

    def readings(now: float) -> dict[str, float]:
        fired = min(now, dies_at_s) // 0.1 * 0.1
        return rolling(speed)(now) | {f"ultrasonic_{side}": metres(fired), f"ultrasonic_{side}_age": now - fired}

    return readings


def stopped_by(watch: FaultWatch) -> str:
    assert watch.stopped is not None
    return watch.stopped.fault.name


def test_a_car_that_does_not_move_is_stopped_after_two_seconds_of_a_small_throttle() -> None:
    watch = FaultWatch(HALL)
    assert drive(watch, 5.0, standing, throttle=0.12) == pytest.approx(2.0, abs=0.03)
    assert stopped_by(watch) == "no motion"
    assert str(watch.stopped).startswith("STOP no motion: told to drive for 2.0 s without motion (told to drive")


@pytest.mark.parametrize("throttle", [0.078, THROTTLE_DEAD, 0.05, 0.0, -0.5])
def test_a_car_that_is_not_told_to_drive_forward_may_stand(throttle: float) -> None:
    assert drive(FaultWatch(HALL), 5.0, standing, throttle) is None


def test_pauses_do_not_hide_a_car_that_does_not_move() -> None:
    watch, stopped_s = FaultWatch(HALL), None
    for tick in range(400):
        pushed = tick % 80 < 64  # a stalled regulator gives neutral for a fifth of each second
        if watch.update(Look(tick * CONTROL_PERIOD_S, standing(0.0), 0.12 if pushed else 0.0)):
            stopped_s = tick * CONTROL_PERIOD_S
            break
    assert stopped_s == pytest.approx(2.0 / 0.8, abs=0.1)


def test_a_tick_of_the_hall_sensor_or_a_speed_begins_the_time_anew() -> None:
    assert drive(FaultWatch(HALL), 20.0, rolling(0.1), throttle=0.12) is None
    assert drive(FaultWatch(HALL), 20.0, lambda now: {"distance": now // 1.9, "speed": 0.0}, throttle=0.12) is None


def test_with_a_dead_hall_wire_a_throttle_that_winds_up_is_stopped_by_its_way() -> None:
    watch, throttle, way_m, speed = FaultWatch(HALL), 0.2, 0.0, 0.0
    for tick in range(400):
        throttle = min(throttle + 0.25 * 0.6 * CONTROL_PERIOD_S, 1.0)  # a speed controller that sees nothing
        speed += (2.64 * (throttle - 0.1) - speed) * CONTROL_PERIOD_S / 0.3
        way_m += speed * CONTROL_PERIOD_S
        if watch.update(Look(tick * CONTROL_PERIOD_S, standing(0.0), throttle)):
            break
    assert stopped_by(watch) == "no motion"
    assert way_m == pytest.approx(FaultLimits().blind_m, abs=0.05)
    assert speed < 1.0


def test_a_pause_between_looks_is_no_time_of_driving() -> None:
    watch = FaultWatch(HALL)
    for now in range(0, 100, 10):
        assert watch.update(Look(float(now), standing(0.0), 0.12)) is None


def test_a_silent_ultrasonic_stops_the_car_after_half_a_second() -> None:
    watch = FaultWatch(ALL)
    assert drive(watch, 5.0, sonar(lambda fired: 2.0 - 0.001 * fired, dies_at_s=2.0)) is not None
    assert stopped_by(watch) == "sonar silent"


@pytest.mark.parametrize("side", ["left", "front", "right"])
def test_each_ultrasonic_that_the_car_has_is_watched(side: str) -> None:
    watch = FaultWatch(HALL | {f"ultrasonic_{side}", f"ultrasonic_{side}_age"})
    when = drive(watch, 5.0, sonar(lambda fired: 2.0 - 0.001 * fired, side, dies_at_s=2.05))
    assert when == pytest.approx(2.5, abs=0.03)
    assert watch.stopped == Finding(FAULTS["sonar silent"], f"{side}, for 0.5 s")


def test_an_ultrasonic_that_never_speaks_has_half_a_second_too() -> None:
    assert drive(FaultWatch(SONAR), 5.0, lambda now: {}) == pytest.approx(0.5, abs=0.03)


def test_a_car_without_ultrasonics_is_not_asked_for_them() -> None:
    assert drive(FaultWatch(HALL), 5.0, rolling(1.0)) is None


def test_a_frozen_ultrasonic_stops_a_car_that_moves_on() -> None:
    watch = FaultWatch(SONAR | HALL)
    limit_m = FaultLimits().frozen_m
    assert limit_m is not None
    assert drive(watch, 60.0, sonar(lambda fired: 4.003)) == pytest.approx(limit_m + 0.1, abs=0.1)
    assert stopped_by(watch) == "sonar frozen"


def test_no_echo_or_one_that_changes_or_a_car_that_stands_is_no_frozen_ultrasonic() -> None:
    assert drive(FaultWatch(SONAR | HALL), 30.0, sonar(lambda fired: NO_ECHO_M)) is None
    assert drive(FaultWatch(SONAR | HALL), 30.0, sonar(lambda fired: 3.0 + 0.01 * (fired // 1 % 2))) is None
    assert drive(FaultWatch(SONAR | HALL), 30.0, sonar(lambda fired: 3.0, speed=0.0), throttle=0.0) is None


def test_a_frozen_ultrasonic_needs_echoes_and_not_only_way() -> None:
    seldom = FaultWatch(SONAR | HALL, FaultLimits(frozen_echoes=100))
    assert drive(seldom, 9.0, sonar(lambda fired: 4.003)) is None


def test_a_range_in_whole_centimetres_may_stay_for_a_longer_way() -> None:
    limits = FaultLimits()
    assert limits.frozen_m is not None
    assert limits.frozen_cm_m is not None
    along_a_wall = limits.frozen_cm_m - 0.1
    assert along_a_wall > limits.frozen_m
    side = HALL | {"ultrasonic_left", "ultrasonic_left_age"}
    assert drive(FaultWatch(side), along_a_wall, sonar(lambda fired: 0.75, "left")) is None
    stopped_s = drive(FaultWatch(side), 60.0, sonar(lambda fired: 0.75, "left"))
    assert stopped_s == pytest.approx(limits.frozen_cm_m + 0.1, abs=0.1)


def test_the_echo_that_makes_it_enough_is_the_one_that_stops() -> None:
    watch = FaultWatch(SONAR | HALL, FaultLimits(frozen_echoes=5, frozen_m=0.1))
    assert drive(watch, 9.0, sonar(lambda fired: 4.003)) == pytest.approx(0.4, abs=0.013)
    assert watch.stopped is not None
    assert watch.stopped.detail == "front, 4.00 m in 5 echoes over 0.4 m"


def test_an_old_image_stops_the_car_and_no_camera_does_not() -> None:
    watch = FaultWatch(HALL)
    when = drive(watch, 5.0, rolling(1.0), image_s=lambda now: min(now, 2.0) - 0.1)
    assert when == pytest.approx(2.4, abs=0.03)
    assert stopped_by(watch) == "camera stale"
    assert drive(FaultWatch(HALL), 5.0, rolling(1.0), image_s=lambda now: None) is None


def test_a_camera_has_half_a_second_for_its_first_image() -> None:
    assert drive(FaultWatch(HALL), 5.0, rolling(1.0), image_s=lambda now: -1e9) == pytest.approx(0.5, abs=0.03)


def test_one_image_again_and_again_stops_a_car_that_moves() -> None:
    watch, times = FaultWatch(HALL), {"image_s": lambda now: now, "changed_s": lambda now: min(now, 2.0)}
    assert drive(watch, 5.0, rolling(1.0), **times) == pytest.approx(2.5, abs=0.03)
    assert stopped_by(watch) == "camera frozen"
    assert drive(FaultWatch(HALL), 5.0, standing, throttle=0.0, **times) is None


def test_the_mean_voltage_warns_and_stops_and_a_dip_does_neither() -> None:
    watch = FaultWatch(frozenset({"battery"}))
    assert drive(watch, 20.0, lambda now: {"battery": 4.0 if now % 5.0 < 0.3 else 7.2}) is None
    assert watch.warnings == ()
    assert drive(FaultWatch(frozenset({"battery"})), 20.0, lambda now: {"battery": 0.0}) is None  # not measured yet
    low = FaultWatch(frozenset({"battery"}))
    assert drive(low, 20.0, lambda now: {"battery": 6.4}) is None
    assert [warning.fault.name for warning in low.warnings] == ["battery low"]
    empty = FaultWatch(frozenset({"battery"}))
    assert drive(empty, 20.0, lambda now: {"battery": 6.4 if now < 5.0 else 5.8}) == pytest.approx(7.2, abs=0.2)
    assert str(empty.stopped).startswith("STOP battery empty: 6.0 V in the mean, below 6 V")


def test_a_voltage_is_judged_when_half_of_the_mean_is_known() -> None:
    watch = FaultWatch(frozenset({"battery"}))
    assert drive(watch, 5.0, lambda now: {"battery": 5.0}) == pytest.approx(2.0 * math.log(2.0), abs=0.03)


@pytest.mark.parametrize(("metres", "stops"), [(0.455, True), (0.46, False)])
def test_too_near_counts_bumper_age_reaction_and_brake(metres: float, stops: bool) -> None:
    # 0.320 m for the brake at 1 m/s, 0.1 m for the reaction, 0.0125 m for the age of the echo, 0.025 m for the bumper
    watch = FaultWatch(SONAR | HALL, brake=-1.0)
    for now, age_s in ((0.1, 0.0125), (0.15, 0.0625), (0.2, 0.0125)):
        readings = {"ultrasonic_front": metres, "ultrasonic_front_age": age_s}
        found = watch.update(Look(now, rolling(1.0)(now) | readings, 0.3))
    assert (found is not None) == stops


def test_something_ahead_stops_the_car_while_the_brake_is_still_enough() -> None:
    for brake in (-1.0, -0.5, 0.0):
        watch = FaultWatch(SONAR | HALL, brake=brake)
        when = drive(watch, 5.0, sonar(lambda fired: 3.0 - fired))
        assert stopped_by(watch) == "too near"
        assert when is not None
        assert -0.1 < 3.0 - when - stopping_m(1.0, brake, FaultLimits().rolling_share) < 0.25  # two echoes, 0.1 s apart


def told_in_each_tick(every: int) -> Callable[[float], dict[str, float]]:
    """A wall 2 m ahead of a car at 1 m/s; each tick a range comes, and a new one in each so manieth."""

    def readings(now: float) -> dict[str, float]:
        ranged_s = round(now / CONTROL_PERIOD_S) // every * every * CONTROL_PERIOD_S
        return rolling(1.0)(now) | {"ultrasonic_front": 2.0 - ranged_s, "ultrasonic_front_age": 0.0}

    return readings


def test_echoes_that_come_in_each_tick_are_noticed_too() -> None:
    watch = FaultWatch(SONAR | HALL)
    assert drive(watch, 2.0, told_in_each_tick(1)) == pytest.approx(2.0 - stopping_m(1.0, 0.0, 0.6) - 0.1, abs=0.08)
    assert stopped_by(watch) == "too near"


def test_one_echo_that_a_board_tells_again_does_not_confirm_itself() -> None:
    def outlier(now: float) -> dict[str, float]:
        """A board that tells its last range each 20 ms, and one wrong echo for one ranging."""
        metres = 0.1 if 1.0 <= now < 1.05 else 4.0 - 0.1 * now
        return rolling(1.0)(now) | {"ultrasonic_front": metres, "ultrasonic_front_age": now % 0.02}

    assert drive(FaultWatch(SONAR | HALL), 3.0, outlier) is None


def test_without_the_brake_the_way_to_stop_is_that_of_a_rolling_car() -> None:
    assert [stopping_m(speed, 0.0) for speed, _ in ROLLING] == [way for _, way in ROLLING]
    assert stopping_m(1.05, 0.0, 0.6) == pytest.approx(0.6 * 1.01)
    assert stopping_m(1.05, -0.5) == pytest.approx((0.34 + 1.01) / 2)


@pytest.mark.parametrize(("speed", "throttle"), [(1.0, -0.3), (0.0, 0.3)])
def test_a_car_that_brakes_or_stands_may_be_near(speed: float, throttle: float) -> None:
    limits = FaultLimits(standstill_s=None, blind_m=None)
    assert drive(FaultWatch(SONAR | HALL, limits), 1.5, sonar(lambda fired: 0.1, speed=speed), throttle) is None


def test_a_single_echo_may_be_an_outlier() -> None:
    watch = FaultWatch(SONAR | HALL)
    assert drive(watch, 5.0, sonar(lambda fired: 0.1 if round(fired * 10) % 5 == 0 else 3.0 + 0.001 * fired)) is None


def test_the_way_to_stop_grows_with_speed_and_meets_what_was_measured() -> None:
    assert [stopping_m(speed) for speed, _ in STOPPING] == [way for _, way in STOPPING]
    assert stopping_m(3.0) == pytest.approx(1.01 + (3.0 - 2.38) * (1.01 - 0.78) / (2.38 - 1.98))


@given(st.floats(0.0, 5.0), st.floats(0.0, 5.0))
def test_a_faster_car_needs_more_way(one: float, other: float) -> None:
    assert (stopping_m(one) - stopping_m(other)) * (one - other) >= 0.0


def test_errors_of_the_bus_are_told_when_they_are_many() -> None:
    few, many = FaultWatch(HALL), FaultWatch(HALL)
    assert drive(few, 60.0, rolling(1.0), retries=lambda now: int(now)) is None
    assert few.warnings == ()
    assert drive(many, 60.0, rolling(1.0), retries=lambda now: int(now * 2)) is None
    assert [str(each).split(":")[0] for each in many.warnings] == ["WARN bus errors"]


def test_late_ticks_are_told_when_they_are_many_and_no_longer_when_they_end() -> None:
    watch = FaultWatch(HALL)
    assert (
        drive(watch, 5.0, rolling(1.0), ticks=lambda now: int(now * 80), late_ticks=lambda now: int(now * 20)) is None
    )
    assert [warning.fault.name for warning in watch.warnings] == ["loop late"]
    later = FaultWatch(HALL)
    late = lambda now: int(min(now, 2.0) * 80)  # noqa: E731
    assert drive(later, 30.0, rolling(1.0), ticks=lambda now: int(now * 80), late_ticks=late) is None
    assert later.warnings == ()


def test_a_first_late_tick_is_not_all_ticks() -> None:
    watch = FaultWatch(HALL)
    assert (
        drive(watch, 0.5, rolling(1.0), ticks=lambda now: int(now * 80), late_ticks=lambda now: int(now * 80)) is None
    )
    assert watch.warnings == ()


def test_the_first_fault_stays_until_the_reset() -> None:
    watch = FaultWatch(HALL | SONAR)
    drive(watch, 5.0, standing, throttle=0.12)
    first = watch.stopped
    assert first is not None
    assert watch.update(Look(9.0, rolling(1.0)(9.0), 0.0)) == first
    watch.reset()
    assert watch.stopped is None
    assert watch.update(Look(9.1, rolling(1.0)(9.1), 0.0)) is None


OFF: Iterable[str] = [field.name for field in fields(FaultLimits) if "None" in str(field.type)]


def test_each_law_can_be_switched_off() -> None:
    watch = FaultWatch(ALL, FaultLimits(**dict.fromkeys(OFF)))
    readings = {"distance": 0.0, "speed": 0.0, "battery": 1.0}
    ages = {name: 9.0 for name in ALL if name.endswith("_age")}
    for tick in range(2000):
        now = tick * CONTROL_PERIOD_S
        assert (
            watch.update(Look(now, readings | ages | {"ultrasonic_front": 0.1}, 0.9, -9.0, -9.0, tick, tick, tick))
            is None
        )
    assert watch.warnings == ()


@pytest.mark.parametrize("field", [field.name for field in fields(FaultLimits)])
@pytest.mark.parametrize("value", [0, -1.0, "1", float("nan"), True])
def test_a_limit_is_a_number_above_0(field: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"faults: {field}"):
        FaultLimits(**{field: value})  # type: ignore[arg-type]


def test_each_fault_has_its_name_its_limits_and_a_law() -> None:
    names = {each.name for each in fields(FaultLimits)}
    for name, fault in FAULTS.items():
        assert name == fault.name
        assert fault.limits
        assert set(fault.limits) <= names
        assert fault.decision in Decision


def test_numbers_that_machines_have_too_are_the_same_and_a_car_in_its_dead_zone_is_not_told_to_drive() -> None:
    assert FaultLimits().silent_s == MAX_SILENCE_S
    assert FaultLimits().driving_throttle > THROTTLE_DEAD
    assert FaultLimits().moving_mps == MOVING_MPS


def test_numbers_that_a_car_file_has_too_are_the_same() -> None:
    assert FaultLimits().battery_empty_v == BatteryLimits().stop_v
    assert FaultLimits().battery_low_v == BatteryLimits().warn_v
