"""The car for RViz: its URDF, written from assets/car.xml, and where its sensors stand."""

from __future__ import annotations

import math
from functools import cache
from xml.etree import ElementTree

import numpy as np

from tral_env.arrays import Array
from tral_env.assets import asset_path
from tral_env.config import CarConfig
from tral_env.geometry import (
    FRONT_SONAR_X_M,
    FULL_LOCK,
    SIDE_SONAR_X_M,
    SIDE_SONAR_Y_M,
    TRACK_M,
    WHEEL_RADIUS_M,
    WHEELBASE_M,
)
from tral_env.ros import topics
from tral_env.ros.msg.geometry import Quaternion, Transform, TransformStamped, Vector3
from tral_env.ros.msg.std import Header
from tral_env.ros.times import stamp

Rpy = tuple[float, float, float]
_CAR = CarConfig()
_OPTICAL: Rpy = (-math.pi / 2, 0.0, -math.pi / 2)
"""REP 103: z of the optical frame looks ahead, x to the right."""
_WHEEL_WIDTH_M = 0.026


def sensor_frames(camera_x: float = _CAR.camera_x) -> dict[str, tuple[str, tuple[float, float, float], Rpy]]:
    """Frame -> the frame that holds it, its place [m], and its roll, pitch, yaw.

    Args:
        camera_x: the camera stands this far ahead of the rear axle, m.
    """
    height = _CAR.sonar_height
    side, front = SIDE_SONAR_X_M, FRONT_SONAR_X_M
    return {
        topics.sonar_frame("left"): (topics.BASE, (side, SIDE_SONAR_Y_M, height), (0.0, 0.0, math.pi / 2)),
        topics.sonar_frame("front"): (topics.BASE, (front, 0.0, height), (0.0, 0.0, 0.0)),
        topics.sonar_frame("right"): (topics.BASE, (side, -SIDE_SONAR_Y_M, height), (0.0, 0.0, -math.pi / 2)),
        topics.IMU_LINK: (topics.BASE, (WHEELBASE_M / 2, 0.0, 0.055), (0.0, 0.0, 0.0)),
        topics.CAMERA_LINK: (topics.BASE, (camera_x, 0.0, _CAR.camera_z), (0.0, 0.0, 0.0)),
        topics.CAMERA_OPTICAL: (topics.CAMERA_LINK, (0.0, 0.0, 0.0), _OPTICAL),
    }


def static_transforms(now_ns: int, camera_x: float = _CAR.camera_x) -> list[TransformStamped]:
    """Where the sensors stand, see `sensor_frames`."""
    return [
        TransformStamped(Header(stamp(now_ns), parent), frame, Transform(Vector3(*place), quaternion(*rpy)))
        for frame, (parent, place, rpy) in sensor_frames(camera_x).items()
    ]


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """A rotation about x, then y, then z of the fixed frame, rad."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return Quaternion(
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


@cache
def robot_description(camera_x: float = _CAR.camera_x) -> str:
    """The car as URDF: boxes, cylinders and ellipsoids of assets/car.xml that a camera sees, wheels, sensor frames.

    Args:
        camera_x: see `sensor_frames`.
    """
    robot = ElementTree.Element("robot", name="tral")
    base = ElementTree.SubElement(robot, "link", name=topics.BASE)
    colours = _materials()
    for geom in _body().findall("geom"):
        if geom.get("class") == "visual":
            _visual(base, geom, colours)
    for frame, (parent, place, rpy) in sensor_frames(camera_x).items():
        ElementTree.SubElement(robot, "link", name=frame)
        _joint(robot, f"{frame}_joint", "fixed", parent, frame, place, rpy)
    for wheel in topics.WHEELS:
        _wheel(robot, wheel)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _model() -> ElementTree.Element:
    return ElementTree.fromstring(asset_path("car.xml").read_text(encoding="utf-8"))


def _body() -> ElementTree.Element:
    body = _model().find("worldbody/body[@name='car']")
    assert body is not None
    return body


def _materials() -> dict[str, str]:
    """Name of a material -> its rgba."""
    return {each.get("name", ""): each.get("rgba", "0.5 0.5 0.5 1") for each in _model().findall("asset/material")}


def _points() -> dict[str, Array]:
    """Name of a mesh of points -> its points (n, 3)."""
    return {
        each.get("name", ""): np.array(each.get("vertex", "").split(), float).reshape(-1, 3)
        for each in _model().findall("asset/mesh")
        if each.get("vertex")
    }


def _visual(link: ElementTree.Element, geom: ElementTree.Element, colours: dict[str, str]) -> None:
    place, rpy, shape, size = _shape(geom)
    visual = ElementTree.SubElement(link, "visual", name=geom.get("name", ""))
    ElementTree.SubElement(visual, "origin", xyz=_text(place), rpy=_text(rpy))
    ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), shape, size)
    name = geom.get("material", "")
    material = ElementTree.SubElement(visual, "material", name=name)
    ElementTree.SubElement(material, "color", rgba=colours[name])


def _shape(geom: ElementTree.Element) -> tuple[Array, Array, str, dict[str, str]]:
    """Place, roll-pitch-yaw, shape and its sizes, as URDF has them; a mesh is the box around its points."""
    kind = geom.get("type", "sphere")
    place = np.array(geom.get("pos", "0 0 0").split(), float)
    # MuJoCo turns about x, y, z of the turned frame; each geom of the car turns about one axis alone.
    rpy = np.radians(np.array(geom.get("euler", "0 0 0").split(), float))
    if kind == "mesh":
        points = _points()[geom.get("mesh", "")]
        low, high = points.min(axis=0), points.max(axis=0)
        return (low + high) / 2, rpy, "box", {"size": _text(high - low)}
    size = np.array(geom.get("size", "").split(), float)
    if "fromto" in geom.attrib:
        ends = np.array(geom.get("fromto", "").split(), float).reshape(2, 3)
        way = ends[1] - ends[0]
        length = float(np.linalg.norm(way))
        x, y, z = (way / length).tolist()
        rpy = np.array([0.0, math.acos(z), math.atan2(y, x)])
        return ends.mean(axis=0), rpy, "cylinder", {"radius": f"{size[0]:g}", "length": f"{length:g}"}
    if kind == "cylinder":
        return place, rpy, "cylinder", {"radius": f"{size[0]:g}", "length": f"{2 * size[1]:g}"}
    return place, rpy, "box", {"size": _text(2 * size)}


def _wheel(robot: ElementTree.Element, wheel: str) -> None:
    """A wheel and, in front, its knuckle."""
    x = WHEELBASE_M if wheel.startswith("front") else 0.0
    y = TRACK_M / 2 if wheel.endswith("left") else -TRACK_M / 2
    parent, place = topics.BASE, (x, y, WHEEL_RADIUS_M)
    if wheel.startswith("front"):
        parent, joint = f"{wheel}_knuckle", f"{wheel}_steering_joint"
        ElementTree.SubElement(robot, "link", name=parent)
        turned = _joint(robot, joint, "revolute", topics.BASE, parent, place, (0.0, 0.0, 0.0), axis="0 0 1")
        lock = f"{1.3 * FULL_LOCK:.4f}"
        ElementTree.SubElement(turned, "limit", lower=f"-{lock}", upper=lock, effort="1", velocity="10")
        place = (0.0, 0.0, 0.0)
    link = ElementTree.SubElement(robot, "link", name=f"{wheel}_wheel")
    visual = ElementTree.SubElement(link, "visual")
    ElementTree.SubElement(visual, "origin", xyz="0 0 0", rpy=f"{math.pi / 2:g} 0 0")
    shape = {"radius": f"{WHEEL_RADIUS_M:g}", "length": f"{_WHEEL_WIDTH_M:g}"}
    ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), "cylinder", shape)
    ElementTree.SubElement(ElementTree.SubElement(visual, "material", name="tyre"), "color", rgba=_materials()["tyre"])
    _joint(robot, f"{wheel}_wheel_joint", "continuous", parent, f"{wheel}_wheel", place, (0.0, 0.0, 0.0), axis="0 1 0")


def _joint(
    robot: ElementTree.Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    place: tuple[float, float, float],
    rpy: Rpy,
    axis: str | None = None,
) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    ElementTree.SubElement(joint, "origin", xyz=_text(place), rpy=_text(rpy))
    if axis is not None:
        ElementTree.SubElement(joint, "axis", xyz=axis)
    return joint


def _text(numbers: object) -> str:
    return " ".join(f"{number:.6g}" for number in np.asarray(numbers, float).tolist())
