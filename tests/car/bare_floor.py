"""A car on an endless bare floor, driven through `Actuation` as the simulation drives it."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from tral_env.actuation import Actuation, ActuatorInputs
from tral_env.assets import asset_path
from tral_env.config import CarConfig
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.simulation.actuators import STEERING_LEAD_STEPS

CAR = CarConfig()
ROW = np.array([0])
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


def floor_model() -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    car = mujoco.MjSpec.from_file(str(asset_path("car.xml")))
    for option in ("timestep", "integrator", "cone", "impratio"):
        setattr(spec.option, option, getattr(car.option, option))
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50, 50, 0.1], contype=0, conaffinity=1
    )
    spec.worldbody.add_frame().attach_body(car.body("car"), "car/", "")
    return spec.compile()


class DrivenCar:
    """One car and its actuation."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        model.dof_frictionloss[model.joint("car/steer").dofadr[0]] = 0.075
        self.data = mujoco.MjData(model)
        self.actuation = Actuation(1, lead_s=STEERING_LEAD_STEPS * model.opt.timestep)
        self.substeps = round(CONTROL_PERIOD_S / model.opt.timestep)
        self.steering_deg: list[float] = []
        self.speeds: list[float] = []

    @property
    def position(self) -> np.ndarray:
        return self.data.joint("car/root").qpos[:3].copy()

    @property
    def yaw(self) -> float:
        w, x, y, z = self.data.joint("car/root").qpos[3:]
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    @property
    def yaw_rate(self) -> float:
        return float(self.data.joint("car/root").qvel[5])

    @property
    def wheel_speed(self) -> float:
        rates = [self.data.joint(f"car/wheel_{wheel}").qvel[0] for wheel in WHEELS]
        return float(np.mean(rates)) * CAR.wheel_radius

    def angle_deg(self, joint: str) -> float:
        return math.degrees(self.data.joint(f"car/{joint}").qpos[0])

    def drive(self, steering: float, throttle: float, seconds: float) -> ActuatorInputs:
        """Hold a command; log angle and speed of every tick."""
        for _ in range(round(seconds / CONTROL_PERIOD_S)):
            drive = self.actuation.apply(ROW, np.array([[steering, throttle]]), np.array([self.wheel_speed]))
            self.data.actuator("car/steer").ctrl = drive.steering_angle[0]
            self.data.actuator("car/drive").ctrl = drive.voltage[0]
            self.model.dof_frictionloss[self.model.joint("car/steer").dofadr[0]] = drive.scrub_torque[0]
            mujoco.mj_step(self.model, self.data, self.substeps)
            self.steering_deg.append(self.angle_deg("steer"))
            self.speeds.append(self.wheel_speed)
        return drive
