"""MuJoCo's indices of the car and its surroundings, looked up by name once."""

from __future__ import annotations

import mujoco
import numpy as np

from tral_env.arrays import Index
from tral_env.config import UltrasonicConfig
from tral_env.course.scene import PREFIX
from tral_env.sensors.ranging import SONARS

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
_CLOCK = 0
"""The time of a sensor's last sample stands here in its history."""


class CarHandles:
    """Where the car's quantities stand in MuJoCo's arrays."""

    def __init__(self, model: mujoco.MjModel, sonar: UltrasonicConfig) -> None:
        """Look everything up; a missing name raises KeyError with the names there are."""
        root = model.joint(f"{PREFIX}root")
        self.root_qpos, self.root_dof = int(root.qposadr[0]), int(root.dofadr[0])
        self.steer_dof = int(model.joint(f"{PREFIX}steer").dofadr[0])
        self.steer_actuator = int(model.actuator(f"{PREFIX}steer").id)
        self.drive_actuator = int(model.actuator(f"{PREFIX}drive").id)
        self.car_bodies = self._subtree(model, model.body(f"{PREFIX}car").id)
        self.tyres = np.array([model.geom(f"{PREFIX}wheel_{wheel}").id for wheel in WHEELS])
        self.hall_wheel = int(model.sensor(f"{PREFIX}wheel_rear_left_pos").adr[0])
        self.wheel_speeds = np.array([int(model.sensor(f"{PREFIX}wheel_{wheel}_vel").adr[0]) for wheel in WHEELS])
        imu = [int(model.sensor(f"{PREFIX}imu_{kind}").adr[0]) for kind in ("gyro", "accelerometer")]
        self.imu = np.array([adr + axis for adr in imu for axis in range(3)])
        """(6,) columns in sensordata of angular rate, then acceleration."""
        contact = int(model.sensor("collision").adr[0])
        self.contact = slice(contact, contact + 7)
        """Columns in sensordata of the deepest contact: number of contacts, place (3), normal (3)."""
        names = [[f"{PREFIX}ultrasonic_{side}_{ray:02d}" for ray in range(sonar.rays)] for side in SONARS]
        rays = [[model.sensor(name) for name in fan] for fan in names]
        self.rays: Index = np.array([[ray.id for ray in fan] for fan in rays])
        """(3, R) sensors of the fans, from right to left as each sonar looks."""
        self.fans: Index = np.array([[int(ray.adr[0]) + k for ray in fan for k in range(4)] for fan in rays])
        """(3, 4R) their columns in sensordata: distance and normal of each ray."""
        self.ray_clocks: Index = model.sensor_historyadr[self.rays].astype(np.int64) + _CLOCK
        """(3, R) columns in history: when each ray was last cast."""
        self.sonar_clocks: Index = self.ray_clocks[:, 0]

    @staticmethod
    def _subtree(model: mujoco.MjModel, root: int) -> Index:
        return np.flatnonzero(model.body_rootid == model.body_rootid[root])
