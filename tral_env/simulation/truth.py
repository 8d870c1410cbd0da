"""Where n cars really are, how fast, and what they touch."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import Index
from tral_env.simulation.physics import Physics


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
        """(n,) speed of the point of contact towards what the car touches, a tick before, m/s; 0: the car touches
        nothing, or leaves it."""
        self._velocity = np.zeros((n, 3))
        """(n, 3) velocity of the rear axle's middle in the course's frame, m/s; yaw rate, rad/s."""

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
        self._velocity[:, :2] = self._physics.qvel[:, dof : dof + 2]
        self._velocity[:, 2] = self._physics.qvel[:, dof + 5]
        self.speed[:] = self._velocity[:, 0] * np.cos(yaw) + self._velocity[:, 1] * np.sin(yaw)

    def update(self) -> None:
        """Read all after a step; a car closes in with the velocity that it had before the step.

        The point of contact p moves with v + w x (p - o): v and w are the velocity and the yaw rate at the rear axle o.
        """
        vx, vy, w = self._velocity.T.copy()
        self.observe()
        sensordata, handles = self._physics.sensordata, self._physics.handles
        normal = sensordata[:, handles.contact_normal]
        self.collision[:] = sensordata[:, handles.contact_found] > 0
        arm = sensordata[:, handles.contact_place][:, :2] - self.pose[:, :2]
        towards = (vx - w * arm[:, 1]) * normal[:, 0] + (vy + w * arm[:, 0]) * normal[:, 1]
        self.closing_speed[:] = np.where(self.collision, np.maximum(towards, 0.0), 0.0)
