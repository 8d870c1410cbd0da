"""Where n cars really are, how fast, and what they touch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.simulation.physics import Physics

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class GroundTruth:
    """Pose, speed and contact of n cars; the arrays are written in place."""

    def __init__(self, n: int, physics: Physics) -> None:
        """Nothing observed yet."""
        self._physics = physics
        self.pose = np.zeros((n, 3))
        """(n, 3) true x, y [m], yaw [rad] of the cars."""
        self.speed = np.zeros(n)
        """(n,) true speed along the car's x axis, m/s."""
        self.collision = np.zeros(n, bool)
        """(n,) whether the car touches anything but the floor."""
        self.closing_speed = np.zeros(n)
        """(n,) speed towards what the car touches, a tick before, m/s; 0 where it touches nothing."""
        self._velocity = np.zeros((n, 2))

    def reset(self, rows: Index) -> None:
        """Read where cars (k,) stand; they touch nothing."""
        self.observe()
        self.collision[rows] = False
        self.closing_speed[rows] = 0.0

    def observe(self) -> None:
        """Read pose and speed from the state."""
        qpos, root = self._physics.qpos, self._physics.handles.root_qpos
        w, z = qpos[:, root + 3], qpos[:, root + 6]
        x, y = qpos[:, root + 4], qpos[:, root + 5]
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        self.pose[:, 0], self.pose[:, 1], self.pose[:, 2] = qpos[:, root], qpos[:, root + 1], yaw
        dof = self._physics.handles.root_dof
        self._velocity[:] = self._physics.qvel[:, dof : dof + 2]
        self.speed[:] = self._velocity[:, 0] * np.cos(yaw) + self._velocity[:, 1] * np.sin(yaw)

    def update(self) -> None:
        """Read all after a step; a car closes in with the velocity that it had before the step."""
        before = self._velocity.copy()
        self.observe()
        sensordata, handles = self._physics.sensordata, self._physics.handles
        normal = sensordata[:, handles.contact_normal]
        self.collision[:] = sensordata[:, handles.contact_found] > 0
        towards = np.abs(before[:, 0] * normal[:, 0] + before[:, 1] * normal[:, 1])
        self.closing_speed[:] = np.where(self.collision, towards, 0.0)
