"""Messages of builtin_interfaces, std_msgs, rosgraph_msgs, rcl_interfaces, lifecycle_msgs and diagnostic_msgs."""

from dataclasses import dataclass, field

from cyclonedds.idl import IdlStruct, types
from cyclonedds.idl.annotations import final

from tral_env.ros.msg.kinds import Sequence


@final
@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """A time of the ROS clock."""

    sec: types.int32 = 0
    nanosec: types.uint32 = 0


@final
@dataclass
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    """A length of time."""

    sec: types.int32 = 0
    nanosec: types.uint32 = 0


@final
@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """When and in which frame."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@final
@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    """Text."""

    data: str = ""


@final
@dataclass
class Bool(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
    """Yes or no."""

    data: bool = False


@final
@dataclass
class ColorRGBA(IdlStruct, typename="std_msgs::msg::dds_::ColorRGBA_"):
    """A colour, each part in [0, 1]."""

    r: types.float32 = 0.0
    g: types.float32 = 0.0
    b: types.float32 = 0.0
    a: types.float32 = 0.0


@final
@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    """The simulated time."""

    clock: Time = field(default_factory=Time)


@final
@dataclass
class Log(IdlStruct, typename="rcl_interfaces::msg::dds_::Log_"):
    """A line of a node's log."""

    stamp: Time = field(default_factory=Time)
    level: types.uint8 = 0
    name: str = ""
    msg: str = ""
    file: str = ""
    function: str = ""
    line: types.uint32 = 0


@final
@dataclass
class State(IdlStruct, typename="lifecycle_msgs::msg::dds_::State_"):
    """A state of a machine."""

    id: types.uint8 = 0
    label: str = ""


@final
@dataclass
class Transition(IdlStruct, typename="lifecycle_msgs::msg::dds_::Transition_"):
    """A transition of a machine."""

    id: types.uint8 = 0
    label: str = ""


@final
@dataclass
class TransitionEvent(IdlStruct, typename="lifecycle_msgs::msg::dds_::TransitionEvent_"):
    """A transition that fired."""

    timestamp: types.uint64 = 0
    transition: Transition = field(default_factory=Transition)
    start_state: State = field(default_factory=State)
    goal_state: State = field(default_factory=State)


@final
@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    """A figure with its name."""

    key: str = ""
    value: str = ""


@final
@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    """How a part does: level 0 ok, 1 warning, 2 error, 3 stale."""

    level: types.byte = 0
    name: str = ""
    message: str = ""
    hardware_id: str = ""
    values: Sequence[KeyValue] = field(default_factory=list)


@final
@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    """How several parts do."""

    header: Header = field(default_factory=Header)
    status: Sequence[DiagnosticStatus] = field(default_factory=list)


@final
@dataclass
class Int64(IdlStruct, typename="std_msgs::msg::dds_::Int64_"):
    """A whole number."""

    data: types.int64 = 0
