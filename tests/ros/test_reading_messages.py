"""Readings become messages and readings again: what was measured, and how old it is."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.interface import CORE_FIELDS, MAX_AGE_S, NO_ECHO_M, Layout
from tral_env.ros import topics
from tral_env.ros.msg.sensor import AckermannDrive, AckermannDriveStamped, JointState, Range
from tral_env.ros.msg.std import Header
from tral_env.ros.msg.vision import Detection3DArray
from tral_env.ros.readings import MessageReadings, ReadingMessages, detections_of, yaw_of, yaw_quaternion
from tral_env.ros.times import nanoseconds, stamp

NOW_NS = 1_700_000_000_123_456_789
LAYOUT = Layout.of(("imu", "battery"))


def reading(name: str) -> st.SearchStrategy[float]:
    field = LAYOUT.fields[LAYOUT.column(name)]
    if name.endswith("_id"):
        return st.integers(0, 19).map(float)
    if name.endswith("_heading"):
        return st.floats(-3.0, 3.0, width=32)
    high = 9.0 if name.endswith("_age") else min(field.high, 1000.0)
    return st.floats(field.low, high, width=32)


@given(st.fixed_dictionaries({name: reading(name) for name in LAYOUT.names}))
def test_a_policy_is_told_what_the_car_measured(readings: dict[str, float]) -> None:
    heard, told = MessageReadings(), {}
    for topic, message in ReadingMessages().of(readings, NOW_NS):
        assert not topic.startswith("/")
        told[topic] = type(message).deserialize(message.serialize(use_version_2=False))
        heard.hear(told[topic])
    core = {field.name: pytest.approx(readings[field.name], abs=1e-5) for field in CORE_FIELDS}
    assert heard.readings(NOW_NS) == core
    imu: Any = told[topics.IMU]
    for axis in "xyz":
        assert getattr(imu.angular_velocity, axis) == readings[f"imu_gyro_{axis}"]
        assert getattr(imu.linear_acceleration, axis) == readings[f"imu_accel_{axis}"]
    battery: Any = told[topics.BATTERY]
    assert battery.voltage == readings["battery"]


def test_an_age_goes_on_while_a_message_is_under_way() -> None:
    heard = MessageReadings()
    heard.hear(Range(header=_header(NOW_NS - 30_000_000), range=1.0))
    assert heard.readings(NOW_NS + 20_000_000) == {"ultrasonic_left": 1.0, "ultrasonic_left_age": pytest.approx(0.05)}
    assert heard.readings(NOW_NS + 20 * 10**9)["ultrasonic_left_age"] == MAX_AGE_S


def test_an_older_message_does_not_replace_a_newer_one() -> None:
    heard = MessageReadings()
    heard.hear(Range(header=_header(NOW_NS), range=1.0))
    heard.hear(Range(header=_header(NOW_NS - 1), range=2.0))
    assert heard.readings(NOW_NS)["ultrasonic_left"] == 1.0


def ranged(metres: float, stamp_ns: int) -> Range:
    (message,) = (
        each
        for _, each in ReadingMessages().of({"ultrasonic_left": metres, "ultrasonic_left_age": 0.0}, stamp_ns)
        if isinstance(each, Range)
    )
    return message


def test_a_reading_from_the_future_is_too_old_to_use_until_its_time_has_come() -> None:
    heard = MessageReadings()
    heard.hear(ranged(2.0, NOW_NS + 10 * 10**9))
    assert heard.readings(NOW_NS)["ultrasonic_left_age"] == MAX_AGE_S


def test_after_a_clock_was_set_back_new_readings_count_again() -> None:
    heard = MessageReadings()
    heard.hear(ranged(2.0, NOW_NS))
    heard.hear(ranged(0.3, NOW_NS - 10 * 10**9))
    assert heard.readings(NOW_NS - 10 * 10**9) == {"ultrasonic_left": pytest.approx(0.3), "ultrasonic_left_age": 0.0}
    assert heard.refused == 0


def test_no_echo_is_infinite_as_rep_117_wants() -> None:
    readings = {"ultrasonic_left": NO_ECHO_M, "ultrasonic_left_age": 0.01}
    told = ReadingMessages().of(readings, NOW_NS, sees=False)[0].message
    assert isinstance(told, Range)
    assert told.range == math.inf
    assert told.header.frame_id == "ultrasonic_left"
    assert nanoseconds(told.header.stamp) == NOW_NS - 10_000_000
    heard = MessageReadings()
    heard.hear(told)
    assert heard.readings(NOW_NS)["ultrasonic_left"] == NO_ECHO_M


def test_a_range_is_told_once() -> None:
    messages = ReadingMessages()

    def told(age_s: float) -> bool:
        readings = {"ultrasonic_left": 1.0, "ultrasonic_left_age": age_s}
        return any(each.topic == topics.RANGES["left"] for each in messages.of(readings, NOW_NS, sees=False))

    assert [told(age_s) for age_s in (MAX_AGE_S, 0.02, 0.0325, 0.045, 0.01, 0.0225)] == [0, 1, 0, 0, 1, 0]


def test_who_waits_for_the_camera_hears_at_its_rate_that_it_sees_nothing() -> None:
    messages, told = ReadingMessages(), 0
    for tick in range(80):
        for each in messages.of({"gate_age": MAX_AGE_S, "marker_age": MAX_AGE_S}, NOW_NS + tick * 12_500_000):
            told += isinstance(each.message, Detection3DArray) and len(each.message.detections) == 0
    assert 13 <= told <= 16


def test_what_is_no_detection_of_ours_is_passed_over() -> None:
    readings = {field.name: 0.0 for field in CORE_FIELDS if field.name.startswith(("gate_", "marker_"))}
    readings["marker_id"] = -1.0
    seen = detections_of(readings, NOW_NS)
    assert [each.id for each in seen.detections] == ["gate_0"]
    seen.detections[0].results[0].hypothesis.class_id = "person"
    heard = MessageReadings()
    heard.hear(seen)
    assert heard.readings(NOW_NS) == {}


@given(st.floats(-3.14, 3.14))
def test_a_yaw_comes_back_from_its_quaternion(yaw: float) -> None:
    assert yaw_of(yaw_quaternion(yaw)) == pytest.approx(yaw)


def _header(time_ns: int):  # type: ignore[no-untyped-def]
    from tral_env.ros.msg.std import Header

    return Header(stamp(time_ns), "ultrasonic_left")


@pytest.mark.parametrize(("told", "heard_m"), [(math.inf, NO_ECHO_M), (-math.inf, 0.03), (math.nan, 1.0), (0.5, 0.5)])
def test_a_range_that_is_no_number_is_heard_as_rep_117_means_it(told: float, heard_m: float) -> None:
    heard = MessageReadings()
    heard.hear(Range(header=_header(NOW_NS), range=1.0))
    heard.hear(Range(header=_header(NOW_NS + 1), min_range=0.03, range=told))
    assert heard.readings(NOW_NS)["ultrasonic_left"] == heard_m


@pytest.mark.parametrize(
    "others",
    [
        JointState(name=["gripper"], position=[1.0], velocity=[1.0]),
        JointState(name=[topics.HALL_WHEEL], position=[0.0]),
    ],
)
def test_joints_of_another_node_are_passed_over(others: JointState) -> None:
    heard = MessageReadings()
    heard.hear(others)
    assert heard.readings(NOW_NS) == {}


def test_a_new_range_is_told_after_a_late_tick_and_an_old_one_is_not() -> None:
    messages = ReadingMessages()

    def told(age_s: float, after_s: float) -> int:
        readings = {"ultrasonic_left": 1.0, "ultrasonic_left_age": age_s}
        return sum(each.topic == topics.RANGES["left"] for each in messages.of(readings, NOW_NS + round(after_s * 1e9)))

    assert told(0.06, 0.0) == 1
    assert told(0.0725, 0.0125) == 0
    assert told(0.095, 0.1) == 1  # fired 0.065 s after the first one
    assert told(0.2, 0.21) == 0  # the same, told 5 ms late


@pytest.mark.parametrize(
    "none",
    [
        Range(header=Header(stamp(NOW_NS), "speed"), range=1.0),
        JointState(name=[topics.HALL_WHEEL], position=[1.0], velocity=[math.nan]),
        AckermannDriveStamped(drive=AckermannDrive(steering_angle=math.nan)),
    ],
)
def test_what_is_no_reading_is_refused_and_counted(none: Any) -> None:
    heard = MessageReadings()
    heard.hear(none)
    assert heard.readings(NOW_NS) == {}
    assert heard.refused > 0


def test_a_detection_at_no_place_is_refused_and_a_later_one_at_a_place_is_not() -> None:
    readings = {field.name: 0.0 for field in CORE_FIELDS if field.name.startswith(("gate_", "marker_"))}
    readings["marker_id"], heard = -1.0, MessageReadings()
    heard.hear(detections_of(readings | {"gate_x": math.nan}, NOW_NS))
    assert (heard.readings(NOW_NS), heard.refused) == ({}, 1)
    heard.hear(detections_of(readings | {"gate_x": 2.0}, NOW_NS))
    assert heard.readings(NOW_NS)["gate_x"] == 2.0
