"""A course for RViz and Foxglove: walls, doors, obstacles, posts, the route, gates and signs."""

from __future__ import annotations

from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.interface import TURN_MARKER_IDS
from tral_env.ros import topics
from tral_env.ros.msg.geometry import Point, Pose, Vector3
from tral_env.ros.msg.std import ColorRGBA, Header
from tral_env.ros.msg.vision import Marker, MarkerArray
from tral_env.ros.readings import yaw_quaternion
from tral_env.ros.times import stamp

CUBE, LINE_STRIP, TEXT, DELETE_ALL = 1, 4, 9, 3
"""Types of visualization_msgs/Marker, and the action that takes all away."""
_COLOURS = {
    "wall": (0.55, 0.58, 0.62), "door": (0.71, 0.40, 0.11), "frame": (0.25, 0.28, 0.31),
    "obstacle": (0.79, 0.64, 0.15), "post": (0.16, 0.42, 0.69),
}  # fmt: skip
_GREEN, _DARK = ColorRGBA(0.18, 0.49, 0.20, 1.0), ColorRGBA(0.05, 0.05, 0.05, 1.0)


def course_markers(plan: Plan, now_ns: int) -> MarkerArray:
    """A course in the frame `map`; what was drawn before is taken away.

    Args:
        plan: the course.
        now_ns: time of ROS, ns.
    """
    header = Header(stamp(now_ns), topics.MAP)
    drawn = [Marker(header, action=DELETE_ALL)]
    for place, yaw, half, kind in zip(plan.box_position, plan.box_yaw, plan.box_size, plan.box_kind, strict=True):
        name = BOX_KINDS[int(kind)]
        pose, size = Pose(Point(*place.tolist()), yaw_quaternion(float(yaw))), Vector3(*(2 * half).tolist())
        colour = ColorRGBA(*_COLOURS.get(name, (0.5, 0.5, 0.5)), 1.0)
        drawn.append(Marker(header, name, len(drawn), CUBE, pose=pose, scale=size, color=colour))
    route = [Point(x, y, 0.02) for x, y in plan.route.tolist()]
    drawn.append(Marker(header, "route", len(drawn), LINE_STRIP, scale=Vector3(0.02), color=_GREEN, points=route))
    for (x, y, yaw), number in zip(plan.gate_pose.tolist(), plan.gate_id.tolist(), strict=True):
        drawn.append(_text(header, len(drawn), "gate", (x, y, yaw), f"gate {number}"))
    signs = {number: turn for turn, number in TURN_MARKER_IDS.items()}
    for (x, y, _), yaw, number in zip(
        plan.marker_position.tolist(), plan.marker_yaw.tolist(), plan.marker_id.tolist(), strict=True
    ):
        if number in signs:
            drawn.append(_text(header, len(drawn), "sign", (x, y, yaw), signs[number]))
    return MarkerArray(drawn)


def _text(header: Header, number: int, name: str, pose: tuple[float, float, float], text: str) -> Marker:
    x, y, yaw = pose
    place = Pose(Point(x, y, 0.6), yaw_quaternion(yaw))
    return Marker(header, name, number, TEXT, pose=place, scale=Vector3(z=0.2), color=_DARK, text=text)
