"""Readings <-> messages: the age of a reading is the time since the stamp of its message."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from cyclonedds.idl import IdlStruct

from tral_env.config import CameraConfig, ImuConfig, UltrasonicConfig
from tral_env.geometry import FULL_LOCK, WHEEL_RADIUS_M
from tral_env.interface import MAX_AGE_S, NO_ECHO_M, NOTHING_SEEN_ID
from tral_env.ros import topics
from tral_env.ros.commands import drive_of, steering_of, throttle_of
from tral_env.ros.msg.geometry import Point, Pose, PoseWithCovariance, Quaternion, Vector3
from tral_env.ros.msg.sensor import AckermannDriveStamped, BatteryState, Imu, JointState, Range
from tral_env.ros.msg.std import Header
from tral_env.ros.msg.vision import (
    BoundingBox3D,
    Detection3D,
    Detection3DArray,
    ObjectHypothesis,
    ObjectHypothesisWithPose,
)
from tral_env.ros.times import nanoseconds, seconds_ns, stamp
from tral_env.sensors.imu import AXES, draw_bias, noise_sigma

SUBJECTS = ("gate", "marker")
_SONARS = frozenset(map(topics.sonar_frame, topics.SIDES))
MAX_AHEAD_S = 0.1
"""A stamp further in the future than this is of another clock: the reading counts as too old. Source: choice."""
CLOCK_SET_S = 1.0
"""A message this much older than the one before it is of a clock that was set back, and no late one. Source: choice."""


def yaw_quaternion(yaw: float) -> Quaternion:
    """A turn about z, rad."""
    return Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def yaw_of(turn: Quaternion) -> float:
    """The turn about z of a quaternion, rad."""
    return math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))


_LOOKS_NS = seconds_ns(1.0 / CameraConfig.rate_hz)
_YOUNGER_NS = seconds_ns(0.02)
"""Less may be the time between reading and telling. Source: choice, below the 0.033 s between two images."""


class Told(NamedTuple):
    """A message for a topic."""

    topic: str
    message: IdlStruct


class ReadingMessages:
    """Turns the readings of each tick into messages; a reading that is not new is told once."""

    def __init__(self) -> None:
        """Nothing told yet."""
        self._ages_s: dict[str, float] = {}
        self._since_ns: dict[str, int] = {}
        self._seen_ns = 0

    def reset(self) -> None:
        """Forget what was told: a new drive."""
        self._ages_s.clear()
        self._since_ns.clear()
        self._seen_ns = 0

    def of(self, readings: Mapping[str, float], now_ns: int, *, sees: bool = True) -> list[Told]:
        """The messages of a tick, without odometry.

        Args:
            readings: by name.
            now_ns: time of the tick, ns.
            sees: whether gates and markers are told, too; not where a camera node does that.
        """
        told = [
            Told(topics.RANGES[side], each) for side in topics.SIDES if (each := self._range(side, readings, now_ns))
        ]
        if sees and (detections := self._detections(readings, now_ns)):
            told.append(Told(topics.DETECTIONS, detections))
        if "imu_gyro_x" in readings:
            told.append(Told(topics.IMU, _imu(readings, now_ns)))
        if "battery" in readings:
            told.append(Told(topics.BATTERY, _battery(readings["battery"], now_ns)))
        steering, throttle = readings.get("steering", 0.0), readings.get("throttle", 0.0)
        if "distance" in readings:
            told.append(Told(topics.JOINTS, _joints(readings, steering, now_ns)))
        applied = AckermannDriveStamped(Header(stamp(now_ns), topics.BASE), drive_of(steering, throttle))
        told.append(Told(topics.APPLIED, applied))
        return told

    def _range(self, side: str, readings: Mapping[str, float], now_ns: int) -> Range | None:
        name = f"ultrasonic_{side}"
        if name not in readings or (fired_ns := self._new(name, readings[f"{name}_age"], now_ns)) is None:
            return None
        metres = readings[name]
        return Range(
            Header(stamp(fired_ns), topics.sonar_frame(side)),
            field_of_view=math.radians(_SONAR.beam_deg),
            min_range=_SONAR.min_range,
            max_range=_SONAR.max_range,
            range=math.inf if metres >= NO_ECHO_M else metres,
        )

    def _detections(self, readings: Mapping[str, float], now_ns: int) -> Detection3DArray | None:
        """What has been seen newly; nothing, at the rate of a camera, so that a listener knows that somebody looks."""
        found = [
            _detection(subject, readings, since_ns)
            for subject in SUBJECTS
            if (since_ns := self._new(subject, readings.get(f"{subject}_age", MAX_AGE_S), now_ns)) is not None
        ]
        if not found and now_ns - self._seen_ns < _LOOKS_NS:
            return None
        self._seen_ns = now_ns
        exposed = max((each.header.stamp for each in found), key=nanoseconds, default=stamp(now_ns))
        return Detection3DArray(Header(exposed, topics.BASE), found)

    def _new(self, name: str, age_s: float, now_ns: int) -> int | None:
        """Time of a reading, ns, if it is new; None: it is old.

        It is new if its age has not grown since the last tick, or, after a late tick, if it is clearly younger than the
        last one.
        """
        before_s, self._ages_s[name] = self._ages_s.get(name, MAX_AGE_S), age_s
        since_ns = now_ns - seconds_ns(age_s)
        grown = age_s > before_s and since_ns - self._since_ns.get(name, since_ns) < _YOUNGER_NS
        if age_s >= MAX_AGE_S or grown:
            return None
        self._since_ns[name] = since_ns
        return since_ns


_SONAR = UltrasonicConfig()


def detections_of(readings: Mapping[str, float], exposed_ns: int) -> Detection3DArray:
    """What one image shows.

    Args:
        readings: `gate_id` .. `marker_heading`; an id of -1: nothing.
        exposed_ns: time of the exposure, ns.
    """
    seen = [subject for subject in SUBJECTS if readings[f"{subject}_id"] != NOTHING_SEEN_ID]
    found = [_detection(subject, readings, exposed_ns) for subject in seen]
    return Detection3DArray(Header(stamp(exposed_ns), topics.BASE), found)


def _detection(subject: str, readings: Mapping[str, float], exposed_ns: int) -> Detection3D:
    x, y, heading = (readings[f"{subject}_{what}"] for what in ("x", "y", "heading"))
    name = f"{subject}_{round(readings[f'{subject}_id'])}"
    pose = Pose(Point(x, y, 0.0), yaw_quaternion(heading))
    return Detection3D(
        Header(stamp(exposed_ns), topics.BASE),
        [ObjectHypothesisWithPose(ObjectHypothesis(name, 1.0), PoseWithCovariance(pose))],
        BoundingBox3D(pose),
        name,
    )


def _imu(readings: Mapping[str, float], now_ns: int) -> Imu:
    rate = Vector3(*(readings[f"imu_gyro_{axis}"] for axis in "xyz"))
    acceleration = Vector3(*(readings[f"imu_accel_{axis}"] for axis in "xyz"))
    return Imu(
        Header(stamp(now_ns), topics.IMU_LINK),
        orientation_covariance=list(_NO_ORIENTATION),
        angular_velocity=rate,
        angular_velocity_covariance=_diagonal(IMU_VARIANCES[:3]),
        linear_acceleration=acceleration,
        linear_acceleration_covariance=_diagonal(IMU_VARIANCES[3:]),
    )


_NO_ORIENTATION = (-1.0, *[0.0] * 8)
"""How sensor_msgs/Imu says that a chip does not measure its orientation."""
IMU_VARIANCES = (noise_sigma(ImuConfig()) ** 2 + draw_bias(np.ones(AXES), ImuConfig()) ** 2).tolist()
"""Of the rates, (rad/s)^2, and accelerations, (m/s^2)^2: noise and the bias that is left, by the model of the chip."""


def _diagonal(variances: Sequence[float]) -> list[float]:
    """A covariance of three numbers that have nothing to do with each other."""
    return np.diag(variances).ravel().tolist()


def _battery(volts: float, now_ns: int) -> BatteryState:
    nan = math.nan
    return BatteryState(
        Header(stamp(now_ns), topics.BASE), voltage=volts, temperature=nan, current=nan, charge=nan, capacity=nan,
        design_capacity=nan, percentage=nan, present=True,
    )  # fmt: skip


def _joints(readings: Mapping[str, float], steering: float, now_ns: int) -> JointState:
    wheels = [f"{wheel}_wheel_joint" for wheel in topics.WHEELS]
    turned, rate = readings["distance"] / WHEEL_RADIUS_M, readings.get("speed", 0.0) / WHEEL_RADIUS_M
    angle = steering * FULL_LOCK
    return JointState(
        Header(stamp(now_ns), topics.BASE),
        [*wheels, *topics.STEERING_JOINTS],
        [turned] * 4 + [angle] * 2,
        [rate] * 4 + [0.0] * 2,
    )


class MessageReadings:
    """Turns messages back into the readings of a policy."""

    def __init__(self) -> None:
        """Nothing heard yet."""
        self._since_ns: dict[str, int] = {}
        self._values: dict[str, float] = {}
        self.heard = self.refused = 0
        """Number of messages until now, and of those that were refused: older than the last one, or no reading."""

    def reset(self) -> None:
        """Forget all: a new drive."""
        self._since_ns.clear()
        self._values.clear()

    def hear(self, message: IdlStruct) -> None:
        """Take a message of a topic of readings; an older one than the last is refused."""
        self.heard += 1
        match message:
            case Range():
                self._hear_range(message)
            case Detection3DArray():
                for detection in message.detections:
                    self._hear_detection(detection)
            case JointState():
                self._hear_joints(message)
            case AckermannDriveStamped():
                self._take({"steering": steering_of(message.drive), "throttle": throttle_of(message.drive)})
            case _:
                pass

    def readings(self, now_ns: int) -> dict[str, float]:
        """All readings with their ages, by name.

        Args:
            now_ns: now, ns.
        """
        ages = {f"{name}_age": _age_s(now_ns - since_ns) for name, since_ns in self._since_ns.items()}
        return self._values | ages

    def _take(self, values: Mapping[str, float]) -> None:
        """Take values over, unless one of them is no number."""
        if all(map(math.isfinite, values.values())):
            self._values |= values
        else:
            self.refused += 1

    def _hear_range(self, message: Range) -> None:
        """REP 117: infinite: no echo; minus infinite: too close to measure; NaN: no measurement."""
        name = message.header.frame_id
        if name not in _SONARS or math.isnan(message.range) or not self._newer(name, message.header):
            self.refused += 1
            return
        self._take({name: {math.inf: NO_ECHO_M, -math.inf: message.min_range}.get(message.range, message.range)})

    def _hear_joints(self, message: JointState) -> None:
        """Other nodes tell joints on this topic too, often without a rate: they are passed over."""
        told = dict(zip(message.name, zip(message.position, message.velocity, strict=False), strict=False))
        if topics.HALL_WHEEL in told:
            angle, rate = told[topics.HALL_WHEEL]
            self._take({"distance": angle * WHEEL_RADIUS_M, "speed": abs(rate) * WHEEL_RADIUS_M})

    def _hear_detection(self, detection: Detection3D) -> None:
        if not detection.results:
            return
        best = max(detection.results, key=lambda result: result.hypothesis.score)
        subject, _, number = best.hypothesis.class_id.partition("_")
        place, heading = best.pose.pose.position, yaw_of(best.pose.pose.orientation)
        is_one = subject in SUBJECTS and number.isdecimal() and all(map(math.isfinite, (place.x, place.y, heading)))
        if not is_one or not self._newer(subject, detection.header):
            self.refused += 1
            return
        self._take(
            {
                f"{subject}_id": float(number),
                f"{subject}_x": place.x,
                f"{subject}_y": place.y,
                f"{subject}_heading": heading,
            }
        )

    def _newer(self, name: str, header: Header) -> bool:
        """Take a stamp over, unless it is a little older than the last one; if it is far older, the clock was set."""
        since_ns = nanoseconds(header.stamp)
        if 0 < self._since_ns.get(name, 0) - since_ns < CLOCK_SET_S * 1e9:
            return False
        self._since_ns[name] = since_ns
        return True


def _age_s(since_exposure_ns: int) -> float:
    """Age of a reading, s; one from the future may be of any age, so it counts as too old to use."""
    age_s = since_exposure_ns / 1e9
    return MAX_AGE_S if age_s < -MAX_AHEAD_S else min(max(age_s, 0.0), MAX_AGE_S)
