"""All message types, and the definitions of those that rosbags has not."""

from __future__ import annotations

import inspect
from typing import Any

from cyclonedds.idl import IdlStruct
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tral_env.ros.definition import ros_name
from tral_env.ros.msg import geometry, graph, sensor, std, vision

OTHERS = {
    "ackermann_msgs/msg/AckermannDrive": """
float32 steering_angle
float32 steering_angle_velocity
float32 speed
float32 acceleration
float32 jerk
""",
    "ackermann_msgs/msg/AckermannDriveStamped": """
std_msgs/Header header
AckermannDrive drive
""",
    "vision_msgs/msg/ObjectHypothesis": """
string class_id
float64 score
""",
    "vision_msgs/msg/ObjectHypothesisWithPose": """
ObjectHypothesis hypothesis
geometry_msgs/PoseWithCovariance pose
""",
    "vision_msgs/msg/BoundingBox3D": """
geometry_msgs/Pose center
geometry_msgs/Vector3 size
""",
    "vision_msgs/msg/Detection3D": """
std_msgs/Header header
ObjectHypothesisWithPose[] results
BoundingBox3D bbox
string id
""",
    "vision_msgs/msg/Detection3DArray": """
std_msgs/Header header
Detection3D[] detections
""",
}
"""The fields of ackermann_msgs 2.0 and vision_msgs 4.1, as their repositories define them."""


def official() -> Any:
    """The official definitions of ROS 2 Jazzy, as rosbags has them, and the others."""
    store = get_typestore(Stores.ROS2_JAZZY)
    found: dict[str, Any] = {}
    for name, text in OTHERS.items():
        found |= get_types_from_msg(text, name)
    store.register(found)
    return store


def all_types() -> list[type[IdlStruct]]:
    return [
        kind
        for module in (std, geometry, sensor, vision, graph)
        for kind in vars(module).values()
        if inspect.isclass(kind) and issubclass(kind, IdlStruct) and kind.__module__ == module.__name__
    ]


ALL = all_types()
NAMES = [ros_name(kind) for kind in ALL]
