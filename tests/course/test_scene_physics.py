"""The model without looks is the same car."""

import mujoco
import numpy as np

from tral_env.course.scene import Pool, build_model


def test_without_looks_the_physics_are_the_same_bit_for_bit() -> None:
    ends = []
    for looks in (True, False):
        model = build_model(Pool(4), looks=looks)
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.2, 3.0
        mujoco.mj_step(model, data, 400)
        ends.append((model.ngeom, data.qpos.copy()))
    (many, seen), (few, plain) = ends
    assert few < many / 2
    assert np.array_equal(seen, plain)
