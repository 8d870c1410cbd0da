"""A model and a state to look at: one car of a batch, with the boxes, markers and materials of its course."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from tral_env.course.plan import Plan
from tral_env.course.scene import Pool, build_model, write_plan


class RenderScene:
    """One car at a time, ready to be rendered."""

    def __init__(self, pool: Pool) -> None:
        """Compile the model; no car is in it yet."""
        self._pool = pool
        self.model = build_model(pool)
        self.data = mujoco.MjData(self.model)
        self._plan: Plan | None = None

    def show(self, plan: Plan, qpos: NDArray[np.float64]) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Put a car and its course into the model.

        Args:
            plan: its course.
            qpos: (nq,) its state.

        Returns:
            The model and its state, kinematics up to date.
        """
        if plan is not self._plan:
            write_plan(self.model, plan, self._pool)
            self._plan = plan
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        return self.model, self.data
