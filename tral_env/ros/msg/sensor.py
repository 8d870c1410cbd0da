"""Messages of sensor_msgs, nav_msgs and ackermann_msgs."""

from dataclasses import dataclass, field

from cyclonedds.idl import IdlStruct, types
from cyclonedds.idl.annotations import final

from tral_env.ros.msg.geometry import PoseWithCovariance, Quaternion, TwistWithCovariance, Vector3
from tral_env.ros.msg.kinds import Floats9, Floats12, Sequence
from tral_env.ros.msg.std import Header

ULTRASOUND = 0
"""`radiation_type` of a Range."""


def zeros_9() -> list[float]:
    """A matrix of zeros; as a covariance: not known."""
    return [0.0] * 9


def zeros_12() -> list[float]:
    """A matrix of zeros."""
    return [0.0] * 12


@final
@dataclass
class Range(IdlStruct, typename="sensor_msgs::msg::dds_::Range_"):
    """A range, m; infinite: no echo (REP 117)."""

    header: Header = field(default_factory=Header)
    radiation_type: types.uint8 = ULTRASOUND
    field_of_view: types.float32 = 0.0
    min_range: types.float32 = 0.0
    max_range: types.float32 = 0.0
    range: types.float32 = 0.0
    variance: types.float32 = 0.0


@final
@dataclass
class Imu(IdlStruct, typename="sensor_msgs::msg::dds_::Imu_"):
    """Rates, rad/s, and accelerations with gravity, m/s^2; a covariance that begins with -1: not measured."""

    header: Header = field(default_factory=Header)
    orientation: Quaternion = field(default_factory=Quaternion)
    orientation_covariance: Floats9 = field(default_factory=zeros_9)
    angular_velocity: Vector3 = field(default_factory=Vector3)
    angular_velocity_covariance: Floats9 = field(default_factory=zeros_9)
    linear_acceleration: Vector3 = field(default_factory=Vector3)
    linear_acceleration_covariance: Floats9 = field(default_factory=zeros_9)


@final
@dataclass
class BatteryState(IdlStruct, typename="sensor_msgs::msg::dds_::BatteryState_"):
    """The drive battery; NaN: not measured."""

    header: Header = field(default_factory=Header)
    voltage: types.float32 = 0.0
    temperature: types.float32 = 0.0
    current: types.float32 = 0.0
    charge: types.float32 = 0.0
    capacity: types.float32 = 0.0
    design_capacity: types.float32 = 0.0
    percentage: types.float32 = 0.0
    power_supply_status: types.uint8 = 0
    power_supply_health: types.uint8 = 0
    power_supply_technology: types.uint8 = 0
    present: bool = False
    cell_voltage: Sequence[types.float32] = field(default_factory=list)
    cell_temperature: Sequence[types.float32] = field(default_factory=list)
    location: str = ""
    serial_number: str = ""


@final
@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    """Angles and rates of joints, rad and rad/s."""

    header: Header = field(default_factory=Header)
    name: Sequence[str] = field(default_factory=list)
    position: Sequence[types.float64] = field(default_factory=list)
    velocity: Sequence[types.float64] = field(default_factory=list)
    effort: Sequence[types.float64] = field(default_factory=list)


@final
@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs::msg::dds_::CompressedImage_"):
    """An image as a JPEG."""

    header: Header = field(default_factory=Header)
    format: str = ""
    data: Sequence[types.uint8] = field(default_factory=list)


@final
@dataclass
class RegionOfInterest(IdlStruct, typename="sensor_msgs::msg::dds_::RegionOfInterest_"):
    """A part of an image, px; all 0: the whole image."""

    x_offset: types.uint32 = 0
    y_offset: types.uint32 = 0
    height: types.uint32 = 0
    width: types.uint32 = 0
    do_rectify: bool = False


@final
@dataclass
class CameraInfo(IdlStruct, typename="sensor_msgs::msg::dds_::CameraInfo_"):
    """The lens."""

    header: Header = field(default_factory=Header)
    height: types.uint32 = 0
    width: types.uint32 = 0
    distortion_model: str = ""
    d: Sequence[types.float64] = field(default_factory=list)
    k: Floats9 = field(default_factory=zeros_9)
    r: Floats9 = field(default_factory=zeros_9)
    p: Floats12 = field(default_factory=zeros_12)
    binning_x: types.uint32 = 0
    binning_y: types.uint32 = 0
    roi: RegionOfInterest = field(default_factory=RegionOfInterest)


@final
@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    """Where the car thinks it is, and how fast it is."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@final
@dataclass
class AckermannDrive(IdlStruct, typename="ackermann_msgs::msg::dds_::AckermannDrive_"):
    """A command: angle of the steering, rad, + = left, and speed, m/s."""

    steering_angle: types.float32 = 0.0
    steering_angle_velocity: types.float32 = 0.0
    speed: types.float32 = 0.0
    acceleration: types.float32 = 0.0
    jerk: types.float32 = 0.0


@final
@dataclass
class AckermannDriveStamped(IdlStruct, typename="ackermann_msgs::msg::dds_::AckermannDriveStamped_"):
    """A command with its time."""

    header: Header = field(default_factory=Header)
    drive: AckermannDrive = field(default_factory=AckermannDrive)
