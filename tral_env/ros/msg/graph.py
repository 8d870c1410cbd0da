"""Messages of rmw_dds_common: which node owns which reader and writer, so that `ros2 node list` knows it."""

from dataclasses import dataclass, field

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final

from tral_env.ros.msg.kinds import Bytes16, Sequence, Text256

GID_SIZE = 16
"""Bytes of a Gid since ROS 2 Iron; Humble has 24, so its `ros2 node list` does not see our nodes."""


def zeros_16() -> list[int]:
    """A Gid of zeros."""
    return [0] * GID_SIZE


@final
@dataclass
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    """The DDS GUID of an entity."""

    data: Bytes16 = field(default_factory=zeros_16)


@final
@dataclass
class NodeEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    """A node and its entities."""

    node_namespace: Text256 = ""
    node_name: Text256 = ""
    reader_gid_seq: Sequence[Gid] = field(default_factory=list)
    writer_gid_seq: Sequence[Gid] = field(default_factory=list)


@final
@dataclass
class ParticipantEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    """The nodes of a participant."""

    gid: Gid = field(default_factory=Gid)
    node_entities_info_seq: Sequence[NodeEntitiesInfo] = field(default_factory=list)
