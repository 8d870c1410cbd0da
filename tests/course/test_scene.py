"""From a plan to MuJoCo: the same corridor as if it had been compiled, in a pool that all corridors share."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from tral_env.assets import asset_path
from tral_env.config import LineConfig
from tral_env.course.generate import SCENARIOS, generate_plan
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, example_path
from tral_env.course.plan import BOX_KINDS, Plan
from tral_env.course.scene import Pool, build_model, place, pool_geoms, write_plan
from tral_env.errors import ConfigError

RAYS = 33
RAY = 4
"""Numbers of a ray: distance and normal."""


@pytest.fixture(scope="module")
def pool() -> Pool:
    return Pool(60, 4, 2)


@pytest.fixture(scope="module")
def model(pool: Pool) -> mujoco.MjModel:
    return build_model(pool)


def office(seed: int = 12) -> Plan:
    return next(
        plan
        for plan in (generate_plan("office", np.random.default_rng(seed + k))[1] for k in range(50))
        if len(plan.box_kind) <= 60 and len(plan.marker_id) <= 4
    )


def compiled(plan: Plan) -> mujoco.MjModel:
    """A model whose walls stand where they belong from the start."""
    spec = mujoco.MjSpec.from_file(str(asset_path("corridor.xml")))
    spec.delete(spec.body("default_course"))
    walls = spec.worldbody.add_body(name="walls", childclass="world")
    for i in range(len(plan.box_kind)):
        quat = [np.cos(plan.box_yaw[i] / 2), 0, 0, np.sin(plan.box_yaw[i] / 2)]
        walls.add_geom(name=f"box_{i:03d}", pos=plan.box_position[i], size=plan.box_size[i], quat=quat)
    car = mujoco.MjSpec.from_file(str(asset_path("car.xml")))
    spec.attach(car, prefix="car/", frame=spec.worldbody.add_frame())
    return spec.compile()


def poses(plan: Plan, count: int) -> np.ndarray:
    """Places on and beside the route, some of them in the wall: (count, 7) of the free joint."""
    rng = np.random.default_rng(0)
    yaw = rng.uniform(-np.pi, np.pi, count)
    xy = plan.route[rng.integers(len(plan.route), size=count)] + rng.uniform(-1.2, 1.2, (count, 2))
    zero = np.zeros(count)
    return np.column_stack([xy, zero, np.cos(yaw / 2), zero, zero, np.sin(yaw / 2)])


def parked_at(model: mujoco.MjModel, plan: Plan, pool: Pool, where: Sequence[float]) -> mujoco.MjData:
    """A car that stands along x in a corridor whose walls are good for physics too."""
    write_plan(model, plan, pool)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data = mujoco.MjData(model)
    data.qpos[:2] = where
    return data


def test_the_corridor_loads_alone_and_shows_the_default_course():
    model = mujoco.MjModel.from_xml_path(str(asset_path("corridor.xml")))
    plan = build_plan(Course.load(example_path("default")))
    ids = np.flatnonzero(model.geom_bodyid == model.body("default_course").id)[: len(plan.box_kind)]
    kinds = [model.geom(i).name.split("_")[0].replace("gate", "post") for i in ids]
    assert kinds == [BOX_KINDS[kind] for kind in plan.box_kind]
    np.testing.assert_allclose(model.geom_pos[ids], plan.box_position, atol=1e-3)
    np.testing.assert_allclose(model.geom_size[ids], plan.box_size, atol=1e-3)
    yaw = 2 * np.arctan2(model.geom_quat[ids, 3], model.geom_quat[ids, 0])
    np.testing.assert_allclose(np.sin(yaw - plan.box_yaw), 0, atol=1e-3)


def test_what_a_caller_writes_into_its_model_is_in_no_other_one():
    mine = build_model(Pool(3))
    mine.geom_pos[:] = 7.0
    assert not (build_model(Pool(3)).geom_pos == 7.0).any()


def test_every_object_has_a_name(model: mujoco.MjModel):
    kinds = (
        (model.ngeom, model.geom),
        (model.nbody, model.body),
        (model.njnt, model.joint),
        (model.nsensor, model.sensor),
    )
    assert all(get(i).name for count, get in kinds for i in range(count))


def test_pool_geoms_are_in_the_order_of_their_names(model: mujoco.MjModel, pool: Pool):
    assert pool.names[0] == "box_000"
    assert pool.names[-3:] == ["marker_003", "tape_000", "tape_001"]
    assert [model.geom(i).name for i in pool_geoms(model, pool)] == pool.names


def test_pool_geoms_follow_what_is_written_to_them(model: mujoco.MjModel, pool: Pool):
    assert not model.geom_sameframe[pool_geoms(model, pool)].any()


def test_spare_geoms_are_parked_out_of_reach(pool: Pool):
    plan = build_plan(Course.load(example_path("ring")))
    placed = place(plan, pool)
    spare = np.r_[len(plan.box_kind) : 60, 60:64, 64 + len(plan.tape) : 66]
    assert (placed.geom_pos[spare, 2] < -5).all()
    assert (placed.geom_size[spare] <= 0.001).all()
    np.testing.assert_allclose(np.linalg.norm(placed.geom_quat, axis=1), 1)


def test_the_tape_that_is_painted_is_as_wide_as_the_line_sensor_takes_it_to_be(pool: Pool):
    placed = place(build_plan(Course.load(example_path("ring"))), pool)
    assert 2 * placed.geom_size[pool.names.index("tape_000"), 1] == LineConfig().tape_width


def test_a_pool_that_is_too_small_is_refused():
    plan = build_plan(Course.load(example_path("ring")))
    with pytest.raises(ConfigError, match=r"Pool\(boxes=12, markers=0, tapes=1\) does not fit into a Pool\(boxes=4"):
        place(plan, Pool(4))


def test_pools_unite_and_know_the_families():
    assert Pool(4, 2, 1).union(Pool(3, 5)) == Pool(4, 5, 1)
    assert all(Pool.for_scenario(name).boxes >= 4 for name in SCENARIOS)
    with pytest.raises(ConfigError, match="did you mean 'loop'"):
        Pool.for_scenario("lop")


def test_rays_and_contacts_in_a_pool_are_those_of_a_compiled_corridor():
    plan = office()
    pool = Pool(60)
    batch = Batch(build_model(pool), 2, 1, True)
    ids, placed = pool_geoms(build_model(pool), pool), place(plan, Pool(60, 4, 2))
    row = 1
    for name in ("geom_pos", "geom_quat", "geom_size"):
        batch.expand(name)[row, ids] = getattr(placed, name)[:60]
    batch.set_const(np.array([row]))
    rival = compiled(plan)
    data = mujoco.MjData(rival)
    hits = 0
    for pose in poses(plan, 60):
        batch.reset(np.array([row]))
        batch.bind("qpos")[row, :7] = pose
        batch.forward(np.array([row]))
        mujoco.mj_resetData(rival, data)
        data.qpos[:7] = pose
        mujoco.mj_forward(rival, data)
        ours, theirs = batch.bind("sensordata")[row], data.sensordata
        np.testing.assert_allclose(ours[: RAYS * RAY : RAY], theirs[: RAYS * RAY : RAY], atol=1e-9)
        walls = rival.body("walls").id
        touching = any(walls in rival.geom_bodyid[contact.geom] for contact in data.contact)
        found = batch.model.sensor("collision").adr[0]
        assert (ours[found] > 0) == touching
        hits += touching
    assert 5 < hits < 55


def test_the_collision_sensor_tells_the_way_into_the_wall(model: mujoco.MjModel, pool: Pool):
    data = parked_at(model, build_plan(Course.load(example_path("ring"))), pool, (4, 0.93))
    mujoco.mj_forward(model, data)
    found, *place, nx, ny, nz = data.sensor("collision").data
    assert found > 0
    np.testing.assert_allclose([nx, ny, nz], [0, 1, 0], atol=1e-6)
    assert place[1] == pytest.approx(1.0, abs=0.03)


def test_dressing_gives_each_kind_its_material(model: mujoco.MjModel, pool: Pool):
    plan = build_plan(Course.load(example_path("default")))
    write_plan(model, plan, pool)
    shown = pool_geoms(model, pool)[np.r_[: len(plan.box_kind), 60:63]]
    worn = [model.material(model.geom_matid[i]).name for i in shown]
    assert worn[:-3] == [BOX_KINDS[kind] for kind in plan.box_kind]
    assert worn[-3:] == ["marker_00", "marker_01", "marker_40"]


def test_redressing_leaves_nothing_behind(pool: Pool):
    fresh, worn = build_model(pool), build_model(pool)
    ring, default = (build_plan(Course.load(example_path(name))) for name in ("ring", "default"))
    write_plan(worn, default, pool)
    write_plan(worn, ring, pool)
    write_plan(fresh, ring, pool)
    shown = pool_geoms(worn, pool)[np.r_[: len(ring.box_kind), 64]]
    for name in ("geom_pos", "geom_quat", "geom_size", "geom_rbound"):
        np.testing.assert_array_equal(getattr(worn, name), getattr(fresh, name))
    np.testing.assert_array_equal(worn.geom_matid[shown], fresh.geom_matid[shown])


def test_standing_on_the_floor_the_car_touches_no_wall(model: mujoco.MjModel, pool: Pool):
    plan = build_plan(Course.load(example_path("default")))
    data = parked_at(model, plan, pool, plan.start[:2])
    for _ in range(400):
        mujoco.mj_step(model, data)
    assert data.sensor("collision").data[0] == 0
    np.testing.assert_allclose(data.qpos[:3], [*plan.start[:2], 0], atol=5e-3)
    assert not any(warning.number for warning in data.warning)
