"""The physics of n cars on MuJoCo's batch: the model, its state, and the boxes that stand around each car."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco.batch import Batch

from tral_env.arrays import Array, Index, Rows, pick
from tral_env.config import UltrasonicConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool, build_model, place, pool_geoms
from tral_env.errors import SimulationError
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.simulation.culling import LocalGeoms
from tral_env.simulation.handles import CarHandles

_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)
_NONE = int(mujoco.mjtStage.mjSTAGE_NONE)

_UNSTABLE = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
"""MuJoCo's warnings about positions, velocities and accelerations that are huge or not finite."""


class Physics:
    """The model, the batch that steps it, and the arrays that are bound to the batch."""

    def __init__(self, n: int, pool: Pool, sonar: UltrasonicConfig, *, nthread: int = 1, near: int = 0) -> None:
        """Compile the model and bind what is read and written.

        Args:
            n: number of cars.
            pool: how many boxes a course may have at the most.
            sonar: the ultrasonics, whose rays are looked up.
            nthread: threads that step the cars.
            near: how many boxes may be near a car, see `LocalGeoms`.
        """
        self._pool = pool
        self._local = LocalGeoms(n, pool.boxes, near)
        around = Pool(self._local.size)
        self.model = build_model(around, looks=False)
        self.handles = CarHandles(self.model, sonar)
        self._boxes = pool_geoms(self.model, around)
        # A thread steps all its cars in one MjData, which stays in the processor's caches.
        self.batch = Batch(self.model, n, nthread, persistent=False)
        self.substeps: int = round(CONTROL_PERIOD_S / self.model.opt.timestep)
        self.time_s = np.zeros(n)
        """(n,) time since reset."""
        self._ticks = np.zeros(n, np.int64)
        bind, expand = self.batch.bind, self.batch.expand
        self.qpos, self.qvel, self.ctrl = bind("qpos"), bind("qvel"), bind("ctrl")
        self.sensordata, self.history = bind("sensordata"), bind("history")
        self._warnings = self.batch.warning[:, _UNSTABLE, 1]
        self.geom = {name: expand(name) for name in ("geom_pos", "geom_quat", "geom_size", "geom_friction")}
        self.mass, self.inertia = expand("body_mass"), expand("body_inertia")
        self.frictionloss, self.sensor_interval = expand("dof_frictionloss"), expand("sensor_interval")

    def place(self, row: int, plan: Plan) -> None:
        """Keep the boxes of a car's course; `reset` puts them into its model."""
        self._local.place(row, place(plan, self._pool))

    def reset(self, rows: Index, plans: Sequence[Plan]) -> None:
        """Put cars (k,) at the start of their k courses, at time 0."""
        start = np.array([plan.start for plan in plans])
        self.update_local_geoms(rows, start[:, :2])
        self.batch.reset(rows, stage=_NONE)
        self._set_initial_pose(rows, start)
        self.time_s[rows] = 0.0
        self._ticks[rows] = 0
        self.batch.forward(rows, stage=_VEL)

    def _set_initial_pose(self, rows: Index, start: Array) -> None:
        root = self.handles.root_qpos
        self.qpos[rows, root : root + 2] = start[:, :2]
        self.qpos[rows, root + 3] = np.cos(start[:, 2] / 2)
        self.qpos[rows, root + 6] = np.sin(start[:, 2] / 2)

    def update_local_geoms(self, rows: Index, position: Array) -> None:
        """Put the boxes near cars (k,) at positions (k, 2) into their models."""
        values = self._local.nearest(rows, position)
        for name, value in zip(("geom_pos", "geom_quat", "geom_size"), values, strict=True):
            self.geom[name][rows[:, None], self._boxes] = value
        # Without this, rays and contacts would miss the boxes.
        self.batch.set_const(rows)

    def step(self, moving: Rows, rows: Index | None, position: Array) -> None:
        """Step cars for one control period.

        Args:
            moving: (k,) the cars that move.
            rows: the same as the batch wants them; None: all.
            position: (n, 2) where the cars are.

        Raises:
            SimulationError: the physics of a car became unstable; it has to be reset.
        """
        if len(far := self._local.due(position)):
            self.update_local_geoms(far, position[far])
        self.batch.step(rows, nstep=self.substeps, stage=_VEL)
        self._check_stable()
        self._ticks[moving] += 1
        self.time_s[moving] = pick(self._ticks, moving) * CONTROL_PERIOD_S

    def _check_stable(self) -> None:
        # MuJoCo itself only counts a warning and puts such a car back to the origin, as if nothing had happened.
        if np.count_nonzero(self._warnings):
            unstable = self._warnings.any(axis=1)
            raise SimulationError(f"unstable physics in rows {np.flatnonzero(unstable).tolist()}")

    def motion(self) -> Array:
        """(n, 6) angular rate, rad/s, and proper acceleration, m/s^2, of the cars.

        The acceleration of a car that was reset may be another car's until a step moves it: see `motion_at_rest`.
        """
        motion: Array = self.sensordata[:, self.handles.imu]
        return motion

    def motion_at_rest(self) -> Array:
        """(n, 6) what `motion` gives for cars that stand: MuJoCo computes these sensors in a step only."""
        motion = np.zeros((len(self.time_s), len(self.handles.imu)))
        motion[:, 5] = -self.model.opt.gravity[2]
        return motion
