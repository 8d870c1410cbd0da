"""From a plan to MuJoCo: a model with a pool of boxes, and where a plan puts them. The only user of `MjSpec`.

All rows of a batch share the structure of one model, so a model holds as many boxes, markers and tapes as the worst
course needs; those that a course does not need are parked under the floor.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array
from tral_env.assets import asset_path
from tral_env.checks import one_of
from tral_env.config import LineConfig
from tral_env.course.families import FAMILIES
from tral_env.course.markers import marker_image, material_name
from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.errors import ConfigError
from tral_env.geometry import MARKER_MODULES, MARKER_QUIET_MODULES
from tral_env.interface import MARKER_IDS

PREFIX = "car/"
"""The name of everything that belongs to the car begins so."""
LOOKS_GROUP = 2
"""The geoms of this group only the eye needs: they weigh nothing and touch nothing."""
_TAPE_HALF_HEIGHT = 0.0005
_PLATE_HALF_DEPTH = 0.001
_QUIET_ZONE = (MARKER_MODULES + 2 * MARKER_QUIET_MODULES) / MARKER_MODULES
"""The edge of a marker's plate over that of its black square."""
_PLASTER, _DADO, _SKIRTING = (236, 232, 220), (150, 172, 186), (84, 92, 100)
_PARKED = (0.0, 0.0, -10.0)
_PARKED_HALF = 0.001
_PARKED_QUAT = (0.8, 0.0, 0.0, 0.6)
"""Any turn but none: MuJoCo takes a geom that is compiled in line with its body to stay so (`geom_sameframe`), whatever
is written to `geom_quat` later."""


@dataclass(frozen=True)
class Pool:
    """How many boxes, markers and strips of tape a model holds."""

    boxes: int
    markers: int = 0
    tapes: int = 0

    @classmethod
    def of(cls, plan: Plan) -> Pool:
        """Count what one plan needs."""
        return cls(len(plan.box_kind), len(plan.marker_id), len(plan.tape))

    @classmethod
    def for_scenario(cls, name: str) -> Pool:
        """Enough for every course of a family.

        Raises:
            ConfigError: no such family.
        """
        one_of("scenario", name, FAMILIES)
        return cls(FAMILIES[name].max_boxes, FAMILIES[name].max_markers)

    def union(self, other: Pool) -> Pool:
        """The smallest pool that holds what either of two pools holds."""
        return Pool(max(self.boxes, other.boxes), max(self.markers, other.markers), max(self.tapes, other.tapes))

    def __ge__(self, other: Pool) -> bool:
        return self.boxes >= other.boxes and self.markers >= other.markers and self.tapes >= other.tapes

    @property
    def names(self) -> list[str]:
        """Names of the pool's geoms, in the order of `Placement`."""
        groups = (("box", self.boxes), ("marker", self.markers), ("tape", self.tapes))
        return [f"{group}_{i:03d}" for group, count in groups for i in range(count)]


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a plan puts the geoms of a pool, in the order of `Pool.names`."""

    geom_pos: Array
    """(P, 3) m."""
    geom_quat: Array
    """(P, 4) w, x, y, z."""
    geom_size: Array
    """(P, 3) half lengths, m."""


def build_model(pool: Pool, *, car: bool = True, looks: bool = True) -> mujoco.MjModel:
    """Compile the corridor's world with a pool of parked boxes and, unless told otherwise, the car.

    The boxes are geoms ``box_000``... of the body ``walls``. The sensor ``collision`` tells whether the car touches
    them: the number of contacts (0: none), then the place (3) and the normal (3) of the deepest one. The normal points
    from the car to what it touches.

    Args:
        pool: how many boxes, markers and tapes.
        car: whether the car is in it.
        looks: whether it holds what only the eye needs; without, the physics are the same and a step costs a sixth
            less.

    Returns:
        A model of the caller's own. What was compiled before is copied, which takes a twentieth of the time.
    """
    return copy.copy(_compiled(pool, car, looks))


@lru_cache(maxsize=16)
def _compiled(pool: Pool, car: bool, looks: bool) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_file(str(asset_path("corridor.xml")))
    spec.delete(spec.body("default_course"))
    if looks:
        _add_marker_materials(spec)
        _paint_walls(spec)
    walls = spec.worldbody.add_body(name="walls", childclass="world")
    for name in pool.names:
        kind = name.split("_")[0]
        walls.add_geom(
            spec.find_default("wall" if kind == "box" else kind),
            name=name,
            pos=_PARKED,
            quat=_PARKED_QUAT,
            size=[_PARKED_HALF] * 3,
        )
    if car:
        spec.attach(
            mujoco.MjSpec.from_file(str(asset_path("car.xml"))), prefix=PREFIX, frame=spec.worldbody.add_frame()
        )
        _add_collision_sensor(spec)
    if not looks:
        for geom in [geom for geom in spec.geoms if geom.group == LOOKS_GROUP]:
            spec.delete(geom)
    return spec.compile()


def _add_marker_materials(spec: mujoco.MjSpec) -> None:
    """Add a texture and a material for each of `MARKER_IDS`, to be shown on the +z face of a flat box."""
    for marker in MARKER_IDS:
        image = np.repeat(marker_image(marker)[..., None], 3, axis=2)
        name = material_name(marker)
        texture = spec.add_texture(
            name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=image.shape[1], height=image.shape[0], nchannel=3
        )
        texture.data = image.tobytes()
        # Matt, or the lamps' reflections would wash the code out.
        material = spec.add_material(name=name, specular=0.0, shininess=0.0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


def _paint_walls(spec: mujoco.MjSpec) -> None:
    """Paint the faces of the walls' cube: skirting board, dado, plaster above."""
    texture = spec.texture("wall")
    rows = np.full((texture.width, 3), _PLASTER)
    rows[: round(0.55 * texture.width)] = _DADO
    rows[: round(0.12 * texture.width)] = _SKIRTING
    upward = np.repeat(rows[:, None], texture.width, axis=1)
    top = np.full_like(upward, _PLASTER)
    # Faces +x, -x, +y, -y, +z, -z as OpenGL lays them out: in the first four images up is left, right, down and up.
    faces = [upward[::-1].swapaxes(0, 1), upward.swapaxes(0, 1), upward, upward[::-1], top, top]
    texture.data = np.concatenate(faces).astype(np.uint8).tobytes()


def _add_collision_sensor(spec: mujoco.MjSpec) -> None:
    """Add what MJCF writes as <contact name="collision" subtree1="car/car" body2="walls" data="found pos normal"/>."""
    kinds = mujoco.mjtConDataField
    wanted = sum(1 << int(kind) for kind in (kinds.mjCONDATA_FOUND, kinds.mjCONDATA_POS, kinds.mjCONDATA_NORMAL))
    reduce_to_nearest = 1
    spec.add_sensor(
        name="collision",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_XBODY,
        objname=f"{PREFIX}car",
        reftype=mujoco.mjtObj.mjOBJ_BODY,
        refname="walls",
        intprm=[wanted, reduce_to_nearest, 1],
    )


def pool_geoms(model: mujoco.MjModel, pool: Pool) -> NDArray[np.int64]:
    """Ids of the pool's geoms in a model, (P,), in the order of `Placement`."""
    first = int(model.body("walls").geomadr[0]) if pool.names else 0
    return first + np.arange(len(pool.names), dtype=np.int64)


def place(plan: Plan, pool: Pool) -> Placement:
    """Put a plan's boxes, markers and tapes on the geoms of a pool; spare geoms are parked.

    Raises:
        ConfigError: the pool is too small.
    """
    if not pool >= Pool.of(plan):
        raise ConfigError(f"a plan of {Pool.of(plan)} does not fit into a {pool}")
    count = pool.boxes + pool.markers + pool.tapes
    pos, size, quat = np.empty((count, 3)), np.full((count, 3), _PARKED_HALF), np.zeros((count, 4))
    pos[:], quat[:, 0] = _PARKED, 1.0
    boxes = slice(0, len(plan.box_kind))
    pos[boxes], size[boxes] = plan.box_position, plan.box_size
    quat[boxes, 0], quat[boxes, 3] = np.cos(plan.box_yaw / 2), np.sin(plan.box_yaw / 2)
    if len(plan.marker_id):
        markers = slice(pool.boxes, pool.boxes + len(plan.marker_id))
        normal = np.column_stack([np.cos(plan.marker_yaw), np.sin(plan.marker_yaw), np.zeros(len(plan.marker_id))])
        pos[markers] = plan.marker_position - _PLATE_HALF_DEPTH * normal
        size[markers] = [_QUIET_ZONE * plan.marker_size / 2] * 2 + [_PLATE_HALF_DEPTH]
        quat[markers] = _upright(plan.marker_yaw)
    if len(plan.tape):
        tapes = slice(pool.boxes + pool.markers, pool.boxes + pool.markers + len(plan.tape))
        along = plan.tape[:, 2:] - plan.tape[:, :2]
        yaw = np.arctan2(along[:, 1], along[:, 0])
        pos[tapes, :2], pos[tapes, 2] = (plan.tape[:, 2:] + plan.tape[:, :2]) / 2, _TAPE_HALF_HEIGHT
        size[tapes, 0] = np.linalg.norm(along, axis=1) / 2
        size[tapes, 1:] = LineConfig().tape_width / 2, _TAPE_HALF_HEIGHT
        quat[tapes, 0], quat[tapes, 3] = np.cos(yaw / 2), np.sin(yaw / 2)
    return Placement(pos, quat, size)


def write_plan(model: mujoco.MjModel, plan: Plan, pool: Pool) -> None:
    """Write a plan into a model made by `build_model(pool)`: places, sizes and materials of its geoms.

    That is enough for rendering; physics need `mujoco.mj_setConst` afterwards, or rays and contacts miss the walls.
    """
    ids, placed = pool_geoms(model, pool), place(plan, pool)
    model.geom_pos[ids], model.geom_quat[ids], model.geom_size[ids] = (
        placed.geom_pos,
        placed.geom_quat,
        placed.geom_size,
    )
    # Culling goes by the radius.
    model.geom_rbound[ids] = np.linalg.norm(placed.geom_size, axis=1)
    kinds = np.array([model.material(kind).id for kind in BOX_KINDS])
    model.geom_matid[ids[: len(plan.box_kind)]] = kinds[plan.box_kind]
    codes = np.array([model.material(material_name(marker)).id for marker in MARKER_IDS])
    first = pool.boxes
    model.geom_matid[ids[first : first + len(plan.marker_id)]] = codes[plan.marker_id]


def _upright(yaw: Array) -> Array:
    """Quaternions of upright plates whose face (+z) looks along yaw.

    The plate's x axis points to (-sin yaw, cos yaw, 0), its y axis upwards, its z axis to (cos yaw, sin yaw, 0).
    """
    # Turn the axes (x, y, z) -> (y, z, x), a third of a turn about (1, 1, 1), and then by yaw about z.
    c, s = np.cos(yaw / 2) / 2, np.sin(yaw / 2) / 2
    return np.column_stack([c - s, c - s, c + s, c + s])
