"""Numbers of the car, its sensors and the task: each with meaning, unit, range and source.

The sources of the car are told in `tral_env.geometry`; "SRF08" is the data sheet of the ultrasonic ranger.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

from tral_env.checks import Bounds as Bounds
from tral_env.checks import as_config as as_config
from tral_env.checks import check_fields
from tral_env.checks import check_number as check_number
from tral_env.checks import check_plausible as check_plausible
from tral_env.checks import one_of as one_of
from tral_env.errors import ConfigError
from tral_env.geometry import (
    FRONT_SONAR_FROM_MIDDLE_M,
    FULL_LOCK_DEG,
    HALL_METRES_PER_TICK,
    HEIGHT_M,
    LENGTH_M,
    MARKER_SIZE_M,
    SCRUB_SPEED,
    SIDE_SONAR_Y_M,
    TRACK_M,
    WHEEL_RADIUS_M,
    WHEELBASE_M,
    WIDTH_M,
)
from tral_env.interface import CONTROL_RATE_HZ


@dataclass(frozen=True, kw_only=True)
class CarConfig:
    """Geometry of the car. Frame: ground below the middle of the rear axle, x forward, y left, z up."""

    wheelbase: float = WHEELBASE_M
    """Distance of the axles, m. Source: ucboard."""
    track: float = TRACK_M
    """Distance of the wheels of an axle, m. Source: ucboard."""
    wheel_radius: float = WHEEL_RADIUS_M
    """Radius of each wheel, m. Source: PSES."""
    full_lock_deg: float = FULL_LOCK_DEG
    """Steering angle of the bicycle model at command 1, deg: a turning radius of 0.64 m. Source: echtzeitsysteme."""
    length: float = LENGTH_M
    """Length of the outline, m. Source: PSES."""
    width: float = WIDTH_M
    """Width of the outline, m. Source: PSES."""
    height: float = HEIGHT_M
    """Height of the outline, m. Source: PSES."""
    mass: float = 1.9
    """Mass of the car ready to drive, kg: 1.45 of kit, motor and pack, 0.45 of computer and sensors. Source: choice."""
    sonar_side: float = SIDE_SONAR_Y_M
    """The side ultrasonics stand this far from the middle line, midway between the axles, m. Source: ucboard."""
    sonar_front: float = FRONT_SONAR_FROM_MIDDLE_M
    """The front ultrasonic stands this far ahead of midway between the axles, m. Source: ucboard."""
    sonar_height: float = 0.10
    """Height of the ultrasonics above the floor, m. Source: choice."""
    camera_x: float = 0.20
    """The camera stands this far ahead of the rear axle, m. Source: choice."""
    camera_z: float = 0.19
    """The camera stands this far above the floor, m. Source: choice."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            positive=tuple(field.name for field in fields(self)),
            plausible={
                **dict.fromkeys(("wheelbase", "track", "length", "width", "height"), (0.02, 5.0, "m")),
                "wheel_radius": (0.005, 0.5, "m"),
                "full_lock_deg": (1.0, 80.0, "deg"),
                "mass": (0.05, 100.0, "kg"),
                **dict.fromkeys(("sonar_side", "sonar_front", "sonar_height", "camera_x", "camera_z"), (0.0, 2.0, "m")),
            },
        )

    @property
    def full_lock(self) -> float:
        """Steering angle of the bicycle model at command 1, rad."""
        return math.radians(self.full_lock_deg)

    @property
    def middle_x(self) -> float:
        """Distance of the side ultrasonics ahead of the rear axle, m: midway between the axles."""
        return self.wheelbase / 2

    @property
    def front_x(self) -> float:
        """Distance of the front ultrasonic ahead of the rear axle, m."""
        return self.middle_x + self.sonar_front


@dataclass(frozen=True, kw_only=True)
class ServoConfig:
    """Steering servo, servo saver and tyres' scrub, seen at the bicycle angle."""

    speed: float = 5.6
    """Fastest change of the steering angle, rad/s: a TSU-01 class servo turns 60 deg in 0.16 s at 6 V, and 0.285 ms of
    pulse, about 25.6 deg of the horn, are 22 deg of steering. Source: ucboard for the pulses, choice for the speed."""
    dead_zone_deg: float = 0.4
    """The servo sets out when its error exceeds this, deg: 5 us of 285 us. Source: choice, usual for its class."""
    travel_deg: float = 25.0
    """The linkage stops this far either side of its own middle, deg. Source: era (Apollo_13: +25 deg)."""
    scrub_torque: float = 0.075
    """Friction of both front tyres about their kingpins at standstill, N m: 0.9 * 9.3 N of axle load on a patch of 9 mm
    mean radius. With the saver's 0.65 N m/rad it holds back 6.6 deg. Source: choice, fits the fault in the report."""
    scrub_speed: float = SCRUB_SPEED
    """Rolling this fast the scrub has fallen to 71 %, m/s: a patch of 2 cm turning at 3 rad/s. Source: choice."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            positive=tuple(field.name for field in fields(self)),
            plausible={
                "speed": (0.1, 50.0, "rad/s"),
                "dead_zone_deg": (0.0, 10.0, "deg"),
                "travel_deg": (1.0, 80.0, "deg"),
                "scrub_torque": (0.0, 10.0, "N m"),
                "scrub_speed": (0.0, 10.0, "m/s"),
            },
        )


@dataclass(frozen=True, kw_only=True)
class EscConfig:
    """Motor controller and motor. Motor and gears are those of `assets/car.xml`, seen at the wheels."""

    dead_zone: float = 0.08
    """Throttle up to which the motor stays off, 0 to 0.9. Source: fit to Velocity.csv of echtzeitsysteme; ucboard's
    +-50 us would be 0.13."""
    switch_s: float = 0.1
    """Brake and neutral must each last this long before the other direction drives, s. Source: ucboard."""
    motor_resistance: float = 0.918
    """Resistance of the motor, ohm. Source: fit, time constant 0.3 s."""
    back_emf: float = 0.0790 / WHEEL_RADIUS_M
    """Back-EMF of the motor at a rolling speed of 1 m/s, V. Source: fit to Velocity.csv of echtzeitsysteme."""
    battery_v: float = 7.2
    """Nominal voltage of the pack, V. Source: ucboard."""
    max_latency_s: float = 0.2
    """Largest delay of a command that can be simulated, s. Source: choice."""
    nominal_latency_s: float = 0.02
    """Delay of a command when nothing is randomized, s. Source: choice."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            positive=("switch_s", "motor_resistance", "back_emf", "battery_v"),
            plausible={
                "dead_zone": (0.0, 0.9, ""),
                "switch_s": (0.0, 5.0, "s"),
                "motor_resistance": (0.0, 100.0, "ohm"),
                "back_emf": (0.0, 100.0, "V"),
                "battery_v": (1.0, 60.0, "V"),
                "max_latency_s": (0.0, 5.0, "s"),
                "nominal_latency_s": (0.0, 5.0, "s"),
            },
        )


@dataclass(frozen=True, kw_only=True)
class UltrasonicConfig:
    """One SRF08 ranger."""

    rays: int = 11
    """Number of rays in the fan that samples the beam, 2 or more. Source: choice."""
    beam_deg: float = 55.0
    """Full width of the beam at -6 dB, deg. Source: SRF08."""
    incidence_limit_deg: float = 22.5
    """A smooth wall met at a larger angle gives no echo, deg. Source: era, 20 to 25."""
    incidence_spread_deg: float = 2.5
    """The limit varies from ranging to ranging by up to this much either way, deg. Source: era, 20 to 25."""
    edge_range: float = 2.0
    """An edge or a slim post on the boresight is heard no farther than this, m. Source: choice, after the SRF04's data
    sheet: a stick of 3 cm is detected at more than 2 m."""
    corner_tolerance: float = 0.26
    """Two walls are an inner corner if the cosine of the angle between them is at most this, 0 to 0.9: 90 +- 15 deg.
    Source: choice."""
    min_range: float = 0.03
    """Nearer echoes are lost in the ringing of the transducer, m. Source: SRF08."""
    max_range: float = 5.0
    """Greatest range in microsecond mode, m. Source: report."""
    mode: str = "us"
    """"us": microsecond mode, to 5 m; "cm": centimetre mode, 0.2 to 3 m in steps of 1 cm. Source: report."""
    cm_min_range: float = 0.2
    """Least range in centimetre mode, m. Source: report."""
    cm_max_range: float = 3.0
    """Greatest range in centimetre mode, m. Source: report."""
    cadence_s: float = 0.065
    """Time that one ranging takes, s. Source: SRF08."""
    jitter_m: float = 0.00865
    """Step between neighbouring wave fronts that may trigger the comparator, m. Source: era."""
    jitter_share: float = 0.3
    """Probability that the wave front before or after the right one triggers; 0: never. Source: choice."""
    crosstalk_share: float = 0.1
    """Probability that a sonar hears a neighbour when they fire together. Source: choice."""
    metres_per_us: float = 1.716e-4
    """Range for a microsecond of flight there and back, m. Source: era."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            positive=("beam_deg", "incidence_limit_deg", "max_range", "cadence_s", "metres_per_us"),
            unit_interval=("jitter_share", "crosstalk_share"),
            plausible={
                "corner_tolerance": (0.0, 0.9, ""),
                "beam_deg": (1.0, 180.0, "deg"),
                "incidence_limit_deg": (1.0, 90.0, "deg"),
                "incidence_spread_deg": (0.0, 45.0, "deg"),
                **dict.fromkeys(("min_range", "cm_min_range"), (0.0, 2.0, "m")),
                **dict.fromkeys(("edge_range", "max_range", "cm_max_range"), (0.0, 20.0, "m")),
                "cadence_s": (0.001, 5.0, "s"),
                "jitter_m": (0.0, 0.2, "m"),
                "metres_per_us": (1e-5, 1e-3, "m"),
            },
        )
        if self.rays < 2:
            raise ConfigError(f"UltrasonicConfig.rays = {self.rays!r}: expected 2 or more")
        one_of("UltrasonicConfig.mode", self.mode, ("us", "cm"))


@dataclass(frozen=True, kw_only=True)
class HallConfig:
    """Hall sensor on the rear left wheel."""

    metres_per_tick: float = HALL_METRES_PER_TICK
    """Travel of the wheel between two ticks, m: 8 magnets on a wheel of 0.032 m. Source: ucboard."""
    timeout_s: float = 0.25
    """Without a tick for this long the car is taken to stand, s. Source: choice."""
    stamp_s: float = 1e-4
    """Resolution of the time stamp of a tick, s. Source: ucboard counts tenths of a millisecond."""
    bounce_s: float = 1e-3
    """A tick counted twice comes again after this long, s. Source: choice."""
    max_speed: float = 5.0
    """A tick that comes faster than at this speed is left out of the speed, m/s. Source: choice."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            positive=("metres_per_tick", "timeout_s", "stamp_s", "bounce_s", "max_speed"),
            plausible={
                "metres_per_tick": (1e-4, 1.0, "m"),
                "timeout_s": (0.01, 10.0, "s"),
                "stamp_s": (0.0, 0.02, "s"),
                "bounce_s": (0.0, 0.05, "s"),
                "max_speed": (0.1, 50.0, "m/s"),
            },
        )


@dataclass(frozen=True, kw_only=True)
class LineConfig:
    """Row of eight photo diodes that look down at floor tape."""

    x: float = 0.30
    """The row stands this far ahead of the rear axle, m: under the front bumper. Source: choice."""
    pitch: float = 0.009525
    """Distance of neighbouring diodes, m. Source: Pololu QTR-8."""
    tape_width: float = 0.019
    """Width of the tape, m; shops sell 0.019 and 0.025. Source: choice."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            positive=("pitch", "tape_width"),
            plausible={"x": (-2.0, 2.0, "m"), "pitch": (0.001, 0.1, "m"), "tape_width": (0.001, 0.5, "m")},
        )


@dataclass(frozen=True, kw_only=True)
class ImuConfig:
    """MEMS gyroscope and accelerometer. Source, where not said: MPU-9250 product specification."""

    gyro_noise_dps: float = 0.01
    """Noise density, deg/s per root Hz."""
    gyro_bias_dps: float = 0.1
    """Standard deviation of the bias that is left, deg/s. Raw it is up to 5; a car that stands before it starts can
    subtract it. Source: choice."""
    gyro_range_dps: float = 500.0
    """Full scale, deg/s: 250, 500, 1000 or 2000."""
    accel_noise_ug: float = 300.0
    """Noise density, millionths of g per root Hz."""
    accel_bias_mg: float = 30.0
    """Standard deviation of the bias, thousandths of g: half of the 60 that the specification gives for x and y."""
    accel_range_g: float = 4.0
    """Full scale, g: 2, 4, 8 or 16."""
    bandwidth_hz: float = 41.0
    """Low pass of the chip, Hz: the setting next to half of the control rate."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            positive=("gyro_range_dps", "accel_range_g", "bandwidth_hz"),
            plausible={
                "gyro_noise_dps": (0.0, 10.0, "deg/s"),
                "gyro_bias_dps": (0.0, 50.0, "deg/s"),
                "gyro_range_dps": (10.0, 10000.0, "deg/s"),
                "accel_noise_ug": (0.0, 1e5, "millionths of g"),
                "accel_bias_mg": (0.0, 2000.0, "thousandths of g"),
                "accel_range_g": (1.0, 500.0, "g"),
                "bandwidth_hz": (0.1, 10000.0, "Hz"),
            },
        )


@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """Intrinsics and mounting of the camera that looks ahead. Pixel (0, 0) is the middle of the upper left pixel."""

    width: int = 640
    """Width of the image, px. Source: report (USB webcam)."""
    height: int = 480
    """Height of the image, px. Source: report (USB webcam)."""
    fx: float = 554.256
    """Focal length along x, px: 60 degrees across. Source: choice, see docs/perception.md."""
    fy: float = 554.256
    """Focal length along y, px."""
    cx: float = 319.5
    """Principal point along x, px."""
    cy: float = 239.5
    """Principal point along y, px."""
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """Coefficients k1, k2, p1, p2, k3 of OpenCV's model."""
    rate_hz: float = 15.0
    """Frames per second, at most the control rate: a camera is asked once a tick. Source: choice, webcams of the era
    gave 10 to 30."""
    marker_size: float = MARKER_SIZE_M
    """Edge of an ArUco marker's black square, m. Source: era."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            positive=("width", "height", "fx", "fy", "rate_hz", "marker_size"),
            plausible={
                **dict.fromkeys(("width", "height"), (1, 20000, "px")),
                **dict.fromkeys(("fx", "fy"), (1.0, 1e5, "px")),
                **dict.fromkeys(("cx", "cy"), (-1e5, 1e5, "px")),
                "rate_hz": (0.1, CONTROL_RATE_HZ, "Hz"),
                "marker_size": (0.005, 2.0, "m"),
            },
        )
        if not isinstance(self.distortion, tuple) or len(self.distortion) != 5:
            raise ConfigError(
                f"CameraConfig.distortion = {self.distortion!r}: expected a tuple of 5 numbers: k1, k2, p1, p2, k3"
            )
        for name, value in zip(("k1", "k2", "p1", "p2", "k3"), self.distortion, strict=True):
            check_number(f"CameraConfig.distortion, {name}", value)

    def scaled(self, width: int, height: int) -> CameraConfig:
        """The lens that sees the same in an image of `width` x `height` px."""
        across, down = width / self.width, height / self.height
        return replace(
            self,
            width=width,
            height=height,
            fx=self.fx * across,
            fy=self.fy * down,
            cx=(self.cx + 0.5) * across - 0.5,
            cy=(self.cy + 0.5) * down - 0.5,
        )


WIDE_LENS = CameraConfig(fx=335.9, fy=333.6, cx=330.2, cy=249.6, distortion=(-0.162, 0.0157, -0.0016, -0.0047, 0.0))
"""The wide lens that a neighbouring group measured (87 degrees across). Source: era."""


@dataclass(frozen=True, kw_only=True)
class TaskConfig:
    """What counts as success, and what it earns."""

    nominal_speed: float = 0.3
    """Speed for the time limit, m/s: the limit is the route's length over it, plus `grace_s`. Source: choice."""
    grace_s: float = 10.0
    """Time that every route gets beyond its length over `nominal_speed`, s. Source: choice."""
    touch_speed: float = 0.2
    """A contact at this closing speed or more is a crash, m/s; one at less is a touch. Source: choice."""
    progress_reward: float = 1.0
    """Reward for a metre along the route."""
    gate_reward: float = 1.0
    """Reward for a gate passed."""
    success_reward: float = 5.0
    """Reward for the goal."""
    failure_reward: float = -2.0
    """Reward for a collision or a missed gate. It is small, so that a learner does not prefer to stand."""
    steering_cost: float = 0.01
    """Cost of the square of the change of the steering command in a tick."""
    time_cost: float = 0.005
    """Cost of a tick."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            positive=("nominal_speed",),
            plausible={
                "nominal_speed": (0.001, 20.0, "m/s"),
                "grace_s": (-3600.0, 86400.0, "s"),
                "touch_speed": (0.0, 20.0, "m/s"),
            },
        )
