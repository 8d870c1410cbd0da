"""A model and a state to look at: one car of a batch, dressed with the materials of its course."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from tral_env.course.plan import Plan
from tral_env.course.scene import Pool, build_model, dress


class Stage:
    """One car at a time, ready to be rendered."""

    def __init__(self, pool: Pool) -> None:
        """Nobody is on the stage yet."""
        self._pool = pool
        self.model = build_model(pool)
        self.data = mujoco.MjData(self.model)
        self._plan: Plan | None = None

    def show(self, plan: Plan, qpos: NDArray[np.float64]) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Bring a car onto the stage.

        Args:
            plan: its course.
            qpos: (nq,) its state.

        Returns:
            The model and its state, kinematics up to date.
        """
        if plan is not self._plan:
            dress(self.model, plan, self._pool)
            self._plan = plan
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        return self.model, self.data
