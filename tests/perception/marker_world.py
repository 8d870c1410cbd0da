"""A room with markers, so small that a test can know everything about it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import mujoco
import numpy as np

from tral_env.config import CameraConfig, CarConfig
from tral_env.course.plan import BOX_KINDS, Plan

SIZE = CameraConfig().marker_size
QUIET = 4 / 3
"""Plate over black square: one cell of white around six of code."""


@dataclass
class World:
    model: mujoco.MjModel
    data: mujoco.MjData
    plan: Plan

    def put_car(self, x: float, y: float, yaw: float) -> None:
        mount = self.data.mocap_pos, self.data.mocap_quat
        mount[0][0] = x, y, 0.0
        mount[1][0] = np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)


def _texture(spec: mujoco.MjSpec, marker: int, mirrored: bool) -> str:
    name = f"marker{marker}{'m' if mirrored else ''}"
    if spec.texture(name) is None:
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        code = np.pad(cv2.aruco.generateImageMarker(dictionary, marker, 192), 32, constant_values=255)
        code = np.ascontiguousarray(code[:, ::-1]) if mirrored else code
        texture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=256, height=256, nchannel=3)
        texture.data = np.repeat(code[..., None], 3, axis=2).tobytes()
        material = spec.add_material(name=name, emission=0.0, specular=0.0, shininess=0.0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    return name


def build(
    markers: list[tuple[int, float, float, float, float]],
    boxes: list[tuple[float, float, float, float, float, float, float]] | None = None,
    mirrored: bool = False,
) -> World:
    """markers: id, x, y, z, yaw of the normal; boxes: x, y, z, yaw and half lengths."""
    boxes = boxes or []
    car = CarConfig()
    spec = mujoco.MjSpec()
    spec.visual.headlight.ambient = [0.5, 0.5, 0.5]
    spec.visual.headlight.diffuse = [0.4, 0.4, 0.4]
    spec.visual.map.znear = 0.002
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], rgba=[0.4, 0.42, 0.45, 1], name="floor")
    mount = spec.worldbody.add_body(name="car", mocap=True)
    mount.add_camera(name="car/front", pos=[car.camera_x, 0, car.camera_z], quat=[0.5, 0.5, -0.5, -0.5])
    for index, (marker, x, y, z, yaw) in enumerate(markers):
        normal = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        right = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        turn = np.stack([right, np.array([0.0, 0.0, 1.0]), normal], axis=1)
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, turn.ravel())
        spec.worldbody.add_geom(
            name=f"marker/{index}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[QUIET * SIZE / 2, QUIET * SIZE / 2, 0.002],
            pos=np.array([x, y, z]) - 0.002 * normal,
            quat=quat,
            material=_texture(spec, marker, mirrored),
        )
    for index, (x, y, z, yaw, *half) in enumerate(boxes):
        spec.worldbody.add_geom(
            name=f"box/{index}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=half,
            pos=[x, y, z],
            quat=[np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)],
            rgba=[0.6, 0.5, 0.4, 1],
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return World(model, data, plan_of(markers, boxes))


def plan_of(
    markers: list[tuple[int, float, float, float, float]],
    boxes: list[tuple[float, float, float, float, float, float, float]] | None = None,
) -> Plan:
    box = np.array(boxes or [], float).reshape(-1, 7)
    face = np.array([marker[1:] for marker in markers], float).reshape(-1, 4)
    return Plan(
        box_position=box[:, :3],
        box_yaw=box[:, 3],
        box_size=box[:, 4:],
        box_kind=np.full(len(box), BOX_KINDS.index("obstacle")),
        route=np.array([[0.0, 0.0], [1.0, 0.0]]),
        start=np.zeros(3),
        marker_position=face[:, :3],
        marker_yaw=face[:, 3],
        marker_id=np.array([marker[0] for marker in markers], np.int64),
    )
