"""Where n cars really are, how fast, and what they touch."""

from __future__ import annotations

import numpy as np

from tral_env.arrays import ALONE, Index, columns, everyone, maximum, plain, where
from tral_env.simulation.physics import Physics


class GroundTruth:
    """Pose, speed and contact of n cars; the arrays are written in place."""

    def __init__(self, n: int, physics: Physics) -> None:
        """Nothing observed yet."""
        handles, self._everyone = physics.handles, everyone(n)
        self._root = physics.qpos[:, handles.root_qpos : handles.root_qpos + 7]
        self._motion = physics.qvel[:, handles.root_dof : handles.root_dof + 6]
        self._contact = physics.sensordata[:, handles.contact]
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
        rows = self._everyone
        x, y, _, w, i, j, z = columns(self._root, rows)
        yaw = plain(np.arctan2(2 * (w * z + i * j), 1 - 2 * (j * j + z * z)))
        vx, vy, *_, turn = columns(self._motion, rows)
        for column, value in enumerate((x, y, yaw)):
            self.pose[rows, column] = value
        for column, value in enumerate((vx, vy, turn)):
            self._velocity[rows, column] = value
        self.speed[rows] = vx * plain(np.cos(yaw)) + vy * plain(np.sin(yaw))

    def update(self) -> None:
        """Read all after a step; a car closes in with the velocity that it had before the step.

        The point of contact p moves with v + w x (p - o): v and w are the velocity and the yaw rate at the rear axle o.
        """
        rows = self._everyone
        # Copies, because `observe` writes the velocity anew.
        vx, vy, w = columns(self._velocity, rows) if rows is ALONE else self._velocity.T.copy()
        self.observe()
        found, x, y, _, nx, ny, _ = columns(self._contact, rows)
        x0, y0, _ = columns(self.pose, rows)
        collision = found > 0
        towards = (vx - w * (y - y0)) * nx + (vy + w * (x - x0)) * ny
        self.collision[rows] = collision
        self.closing_speed[rows] = where(collision, maximum(towards, 0.0), 0.0)
