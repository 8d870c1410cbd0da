"""The car and its corridor as triangles, made from MuJoCo's model and from the plan of a course."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.visual import ColorVisuals

from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.course.scene import LOOKS_GROUP, PREFIX, Pool, build_model

Array = NDArray[np.float64]
Colour = tuple[int, int, int, int]
_BANDS = ((0.0, 0.12, (84, 92, 100, 255)), (0.12, 0.55, (150, 172, 186, 255)), (0.55, 1.0, (236, 232, 220, 255)))
"""Skirting board, dado and plaster of a wall: shares of its height, and colour."""
_FLOOR = ((122, 127, 132, 255), (130, 135, 140, 255))
"""Colours of the floor's squares."""
_SQUARE_M = 1.0
_SHARP_FACES = 72
"""A mesh of more faces is round."""
_ROOM_M = 2.0
"""The floor reaches so far beyond the walls."""


def car_model() -> mujoco.MjModel:
    """A model that holds the car alone, with what the eye needs."""
    return build_model(Pool(0))


def body_meshes(model: mujoco.MjModel) -> dict[str, trimesh.Trimesh]:
    """Each body of the car as one mesh in its own frame: name -> mesh, with the colours of its materials."""
    parts: dict[str, list[trimesh.Trimesh]] = {}
    for geom in np.flatnonzero(model.geom_group == LOOKS_GROUP):
        name = model.body(model.geom_bodyid[geom]).name
        if name.startswith(PREFIX):
            parts.setdefault(name, []).append(_geom_mesh(model, int(geom)))
    return {name: _joined(meshes) for name, meshes in parts.items()}


def tint(mesh: trimesh.Trimesh, colour: tuple[int, int, int], share: float) -> None:
    """Mix a colour into those of a mesh."""
    visual: Any = mesh.visual
    colours = np.array(visual.vertex_colors, float)
    colours[:, :3] += share * (linear((*colour, 255))[:3] - colours[:, :3])
    mesh.visual = ColorVisuals(mesh, vertex_colors=np.rint(colours).astype(np.uint8))


def standing_car() -> trimesh.Trimesh:
    """The whole car as one mesh, with its origin on the floor below the point whose pose is told."""
    model = car_model()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    parts = []
    for name, mesh in body_meshes(model).items():
        body = data.body(name)
        place = np.eye(4)
        place[:3, :3], place[:3, 3] = body.xmat.reshape(3, 3), body.xpos
        mesh.apply_transform(place)
        parts.append(mesh)
    return _joined(parts)


def _joined(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    joined: Any = trimesh.util.concatenate(parts)
    mesh: trimesh.Trimesh = joined
    return mesh


def _geom_mesh(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh:
    mesh = _SHAPES[mujoco.mjtGeom(model.geom_type[geom])](model, geom)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = turn.reshape(3, 3), model.geom_pos[geom]
    mesh.apply_transform(place)
    material = int(model.geom_matid[geom])
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    return _painted(mesh, _bytes(rgba))


def _painted(mesh: trimesh.Trimesh, colour: Colour) -> trimesh.Trimesh:
    """The mesh in one colour; few faces share no corner, so that their edges look sharp."""
    if len(mesh.faces) <= _SHARP_FACES:
        mesh.unmerge_vertices()
    mesh.visual = ColorVisuals(mesh, vertex_colors=np.tile(linear(colour), (len(mesh.vertices), 1)))
    return mesh


def linear(colour: Colour) -> NDArray[np.uint8]:
    """A colour of a screen (sRGB) as the one that a glTF file wants for a corner: proportional to the light."""
    share = np.array(colour) / 255.0
    share[:3] = share[:3] ** 2.2
    return np.rint(255.0 * share).astype(np.uint8)


def glb(mesh: trimesh.Trimesh) -> bytes:
    """The mesh as a binary glTF file, with a matt surface."""
    data: Any = mesh.export(file_type="glb", tree_postprocessor=_matt)
    return bytes(data)


def _matt(tree: dict[str, Any]) -> None:
    """Give all parts of a glTF file a surface: without one, they would be of metal."""
    tree["materials"] = [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9}}]
    for mesh in tree["meshes"]:
        for part in mesh["primitives"]:
            part["material"] = 0


def _mesh(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh:
    mesh = model.mesh(model.geom_dataid[geom])
    first, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
    face, faces = int(mesh.faceadr[0]), int(mesh.facenum[0])
    return trimesh.Trimesh(model.mesh_vert[first : first + count], model.mesh_face[face : face + faces], process=False)


def _ellipsoid(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh:
    ball: trimesh.Trimesh = trimesh.creation.icosphere(subdivisions=2)
    ball.apply_transform(np.diag([*model.geom_size[geom], 1.0]))
    return ball


_SHAPES: dict[mujoco.mjtGeom, Callable[[mujoco.MjModel, int], trimesh.Trimesh]] = {
    mujoco.mjtGeom.mjGEOM_MESH: _mesh,
    mujoco.mjtGeom.mjGEOM_BOX: lambda m, g: trimesh.creation.box(2.0 * m.geom_size[g]),
    mujoco.mjtGeom.mjGEOM_CYLINDER: lambda m, g: trimesh.creation.cylinder(
        m.geom_size[g, 0], 2.0 * m.geom_size[g, 1], sections=24
    ),
    mujoco.mjtGeom.mjGEOM_CAPSULE: lambda m, g: trimesh.creation.capsule(
        2.0 * m.geom_size[g, 1], m.geom_size[g, 0], count=(8, 8)
    ),
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: _ellipsoid,
    mujoco.mjtGeom.mjGEOM_SPHERE: lambda m, g: trimesh.creation.icosphere(2, m.geom_size[g, 0]),
}


def course_mesh(plan: Plan) -> trimesh.Trimesh:
    """Walls, doors, frames, boxes and posts of a course as one mesh in the course's frame."""
    colours = _box_colours()
    meshes = []
    for position, yaw, half, kind in zip(plan.box_position, plan.box_yaw, plan.box_size, plan.box_kind, strict=True):
        name = BOX_KINDS[kind]
        bands = _BANDS if name == "wall" else ((0.0, 1.0, colours[name]),)
        meshes += [_box(position, yaw, half, low, high, colour) for low, high, colour in bands]
    return _joined(meshes)


def _box(position: Array, yaw: float, half: Array, low: float, high: float, colour: Colour) -> trimesh.Trimesh:
    """A part of a box, from a share of its height to another one."""
    extents = 2.0 * np.array([half[0], half[1], half[2] * (high - low)])
    cos, sin = np.cos(yaw), np.sin(yaw)
    place = np.array([[cos, -sin, 0.0, 0.0], [sin, cos, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    place[:3, 3] = position[0], position[1], position[2] + half[2] * (low + high - 1.0)
    return _painted(trimesh.creation.box(extents, place), colour)


def _box_colours() -> dict[str, Colour]:
    """Kind of a box -> colour of its material."""
    model = build_model(Pool(0), car=False)
    return {kind: _bytes(model.mat_rgba[model.material(kind).id]) for kind in BOX_KINDS}


def _bytes(rgba: Array) -> Colour:
    red, green, blue, alpha = (round(255 * float(share)) for share in rgba)
    return red, green, blue, alpha


def floor_mesh(plan: Plan) -> trimesh.Trimesh:
    """Squares of 1 m below a course, and a little beyond it."""
    reach = np.linalg.norm(plan.box_size[:, :2], axis=1)[:, None] + _ROOM_M
    points = plan.box_position[:, :2]
    low = np.floor((points - reach).min(axis=0) / _SQUARE_M).astype(int)
    high = np.ceil((points + reach).max(axis=0) / _SQUARE_M).astype(int)
    columns, rows = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
    corner = np.column_stack([columns.ravel(), rows.ravel()])
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    flat = (corner[:, None, :] + square) * _SQUARE_M
    vertices = np.concatenate([flat, np.zeros((*flat.shape[:2], 1))], axis=2).reshape(-1, 3)
    first = 4 * np.arange(len(corner))[:, None]
    faces = np.concatenate([np.add(first, [0, 1, 2]), np.add(first, [0, 2, 3])])
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    tone = np.array([linear(each) for each in _FLOOR])[corner.sum(axis=1) % 2]
    mesh.visual = ColorVisuals(mesh, vertex_colors=np.repeat(tone, 4, axis=0))
    return mesh


def tape_mesh(plan: Plan, width: float) -> trimesh.Trimesh | None:
    """Floor tape of a course; None: it has none."""
    strips = []
    for x0, y0, x1, y1 in plan.tape:
        length, yaw = float(np.hypot(x1 - x0, y1 - y0)), float(np.arctan2(y1 - y0, x1 - x0))
        middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2, 0.001])
        strips.append(_box(middle, yaw, np.array([length / 2, width / 2, 0.001]), 0.0, 1.0, (15, 15, 18, 255)))
    return _joined(strips) if strips else None
