"""Messages of vision_msgs and visualization_msgs."""

from dataclasses import dataclass, field

from cyclonedds.idl import IdlStruct, types
from cyclonedds.idl.annotations import final

from tral_env.ros.msg.geometry import Point, Pose, PoseWithCovariance, Vector3
from tral_env.ros.msg.kinds import Sequence
from tral_env.ros.msg.sensor import CompressedImage
from tral_env.ros.msg.std import ColorRGBA, Duration, Header


@final
@dataclass
class ObjectHypothesis(IdlStruct, typename="vision_msgs::msg::dds_::ObjectHypothesis_"):
    """What it may be."""

    class_id: str = ""
    score: types.float64 = 0.0


@final
@dataclass
class ObjectHypothesisWithPose(IdlStruct, typename="vision_msgs::msg::dds_::ObjectHypothesisWithPose_"):
    """What it may be, and where."""

    hypothesis: ObjectHypothesis = field(default_factory=ObjectHypothesis)
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)


@final
@dataclass
class BoundingBox3D(IdlStruct, typename="vision_msgs::msg::dds_::BoundingBox3D_"):
    """A box around it."""

    center: Pose = field(default_factory=Pose)
    size: Vector3 = field(default_factory=Vector3)


@final
@dataclass
class Detection3D(IdlStruct, typename="vision_msgs::msg::dds_::Detection3D_"):
    """Something that was seen."""

    header: Header = field(default_factory=Header)
    results: Sequence[ObjectHypothesisWithPose] = field(default_factory=list)
    bbox: BoundingBox3D = field(default_factory=BoundingBox3D)
    id: str = ""


@final
@dataclass
class Detection3DArray(IdlStruct, typename="vision_msgs::msg::dds_::Detection3DArray_"):
    """All that was seen in an image."""

    header: Header = field(default_factory=Header)
    detections: Sequence[Detection3D] = field(default_factory=list)


@final
@dataclass
class UVCoordinate(IdlStruct, typename="visualization_msgs::msg::dds_::UVCoordinate_"):
    """A place in a texture."""

    u: types.float32 = 0.0
    v: types.float32 = 0.0


@final
@dataclass
class MeshFile(IdlStruct, typename="visualization_msgs::msg::dds_::MeshFile_"):
    """A file of a mesh."""

    filename: str = ""
    data: Sequence[types.uint8] = field(default_factory=list)


@final
@dataclass
class Marker(IdlStruct, typename="visualization_msgs::msg::dds_::Marker_"):
    """Something that RViz draws."""

    header: Header = field(default_factory=Header)
    ns: str = ""
    id: types.int32 = 0
    type: types.int32 = 0
    action: types.int32 = 0
    pose: Pose = field(default_factory=Pose)
    scale: Vector3 = field(default_factory=Vector3)
    color: ColorRGBA = field(default_factory=ColorRGBA)
    lifetime: Duration = field(default_factory=Duration)
    frame_locked: bool = False
    points: Sequence[Point] = field(default_factory=list)
    colors: Sequence[ColorRGBA] = field(default_factory=list)
    texture_resource: str = ""
    texture: CompressedImage = field(default_factory=CompressedImage)
    uv_coordinates: Sequence[UVCoordinate] = field(default_factory=list)
    text: str = ""
    mesh_resource: str = ""
    mesh_file: MeshFile = field(default_factory=MeshFile)
    mesh_use_embedded_materials: bool = False


@final
@dataclass
class MarkerArray(IdlStruct, typename="visualization_msgs::msg::dds_::MarkerArray_"):
    """Several things that RViz draws."""

    markers: Sequence[Marker] = field(default_factory=list)
