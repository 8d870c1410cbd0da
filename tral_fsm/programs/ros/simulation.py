"""The simulated car as the body of the car node."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tral_env.config import CarConfig
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.perception.degrade import ImageCorruption
from tral_env.ros import topics
from tral_env.ros.body import Tick
from tral_env.ros.msg.geometry import (
    Point,
    Pose,
    PoseWithCovariance,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
)
from tral_env.ros.msg.sensor import Odometry
from tral_env.ros.msg.std import Header, String
from tral_env.ros.readings import Told, yaw_quaternion
from tral_env.ros.times import stamp
from tral_env.world import how_it_ended
from tral_fsm.control.speed import ROLLING_MPS, SingleBrake
from tral_fsm.programs.ros.course_markers import course_markers

if TYPE_CHECKING:
    from tral_env.twin.camera import RenderRequest, RenderSetup
    from tral_env.world import World

_STOP_BRAKE = 1.0
"""Throttle against the direction of travel with which a car stops that is not armed any more. Source: choice."""


@dataclass(frozen=True, kw_only=True)
class SimulationOptions:
    """Which simulated car drives where."""

    scenario: str = "office"
    course: str | None = None
    seed: int = 7
    randomization: str = "default"
    camera: str = "projected"
    """"projected": the car's own readings tell gates and markers. "rendered": a process renders the camera's images
    and serves them; the node `camera` looks at them."""
    real_time: bool = True
    """Whether a tick takes its 1/80 s; else as long as it takes."""


class SimulatedBody:
    """One car of TralCorridor-v0. Before it is armed first it waits at the start, and its time stands."""

    name = "simulation"

    def __init__(self, options: SimulationOptions) -> None:
        """Build the world, and put the car at the start.

        Raises:
            ConfigError: there is no such family, course or level.
        """
        import gymnasium as gym

        self._options = options
        self.env = gym.make(
            "tral_env:TralCorridor-v0",
            scenario=options.scenario,
            course=options.course,
            randomization=options.randomization,
            groups=("imu", "battery"),
            disable_env_checker=True,
        )
        self._world: World = self.env.unwrapped.world  # type: ignore[attr-defined]
        self._layout = self._world.layout
        self.sim_time_s = 0.0
        self.sees, self.camera_x = options.camera == "projected", CarConfig.camera_x
        self._camera: SimulatedCamera | None = None
        self._due_s = time.monotonic()
        self.reset(options.seed)

    def reset(self, seed: int) -> None:
        """See `Body.reset`."""
        self._seed = seed
        observation, self.info = self.env.reset(seed=seed)
        self._brake = SingleBrake()
        self._tick = Tick(self._named(observation))
        self._waits, self._over, self._told = True, "", False
        if self._camera is not None:
            self._camera.place()
        elif not self.sees:
            self._camera = SimulatedCamera(self._world)

    def arm(self) -> Tick:
        """See `Body.arm`; a drive that is over begins again."""
        if self._over:
            self.reset(self._seed)
        self._due_s = time.monotonic() + CONTROL_PERIOD_S
        return self._tick

    def step(self, steering: float, throttle: float) -> Tick:
        """See `Body.step`."""
        self._waits = False
        if not self._over:
            observation, _, terminated, truncated, self.info = self.env.step(np.array([steering, throttle], np.float32))
            self._over = how_it_ended(self.info) if terminated or truncated else ""
            self._tick = Tick(self._named(observation), self._over)
        self._pace()
        return self._tick

    def rest(self) -> Tick:
        """See `Body.rest`."""
        if self._waits or self._over:
            self._pace()
            return self._tick
        brakes = self._brake.tick(self._tick.readings["speed"] > ROLLING_MPS)
        tick = self.step(0.0, -_STOP_BRAKE if brakes else 0.0)
        if not self._options.real_time:
            time.sleep(CONTROL_PERIOD_S)  # no answer holds back the time of a car that is not armed
        return tick

    def stop(self) -> None:
        """See `Body.stop`: from now on `rest` brakes, once."""
        self._brake = SingleBrake()

    def extra(self, now_ns: int) -> Sequence[Told]:
        """Where the car is, and how its drive ended."""
        x, y, yaw = np.asarray(self.info["pose"]).tolist()
        pose = Pose(Point(x, y, 0.0), yaw_quaternion(yaw))
        physics = self._world.sim.physics
        turning = float(physics.qvel[0, physics.handles.root_dof + 5])
        twist = Twist(Vector3(float(self.info["speed_mps"])), Vector3(z=turning))
        header = Header(stamp(now_ns), topics.MAP)
        told = [Told(topics.TRUTH, Odometry(header, topics.BASE, PoseWithCovariance(pose), TwistWithCovariance(twist)))]
        if self._over and not self._told:
            self._told = True
            told.append(self.result())
        return told

    def latched(self, now_ns: int) -> Sequence[Told]:
        """The course, and where it begins."""
        plan = self.env.unwrapped.plan  # type: ignore[attr-defined]
        x, y, yaw = plan.start.tolist()
        start = TransformStamped(
            Header(stamp(now_ns), topics.MAP), topics.ODOM, Transform(Vector3(x, y), yaw_quaternion(yaw))
        )
        told = [Told(topics.TF_STATIC, start), Told(topics.COURSE, course_markers(plan, now_ns))]
        if self._camera is not None:
            told.append(Told(topics.CAMERA_URL, String(self._camera.url)))
        return told

    def result(self) -> Told:
        """How the drive ended."""
        keys = ("success", "collision", "missed_gate", "progress", "time_s", "gates_passed", "gates_total")
        told: dict[str, Any] = {key: np.asarray(self.info[key]).item() for key in keys}
        return Told(topics.RESULT, String(json.dumps({"seed": self._seed, "ended": self._over, **told})))

    def close(self) -> None:
        """See `Body.close`."""
        if self._camera is not None:
            self._camera.close()
        self.env.close()

    def _named(self, observation: Any) -> dict[str, float]:
        return {name: float(value) for name, value in self._layout.unpack(observation).items()}

    def _pace(self) -> None:
        self.sim_time_s += 0.0 if self._waits else CONTROL_PERIOD_S
        if self._camera is not None:
            self._camera.look()
        if not self._options.real_time:
            if self._waits or self._over:
                time.sleep(CONTROL_PERIOD_S)
            return
        now_s = time.monotonic()
        if now_s < self._due_s:
            time.sleep(self._due_s - now_s)
        self._due_s = max(self._due_s, now_s) + CONTROL_PERIOD_S


class SimulatedCamera:
    """A process that renders what the camera of a simulated car sees, in real time, and serves it as MJPEG."""

    def __init__(self, world: World) -> None:
        """Start it.

        Raises:
            RenderError: this computer cannot render.
        """
        from tral_env.twin.camera import CameraStream

        self._world = world
        self._camera = CameraStream(self._render_setup(), self._render_request())
        self.url = self._camera.url

    def place(self) -> None:
        """A new episode."""
        self._camera.place(self._render_setup())

    def look(self) -> None:
        """Expose an image, if it is time for one."""
        if self._camera.is_due(time.monotonic()):
            self._camera.expose(self._render_request())

    def close(self) -> None:
        """End the process."""
        self._camera.close()

    def _render_setup(self) -> RenderSetup:
        from tral_env.twin.camera import RenderSetup

        sim, plan = self._world.sim, self._world.plans[0]
        assert plan is not None
        drawn = {name: float(values[0]) for name, values in sim.car_parameters.drawn.items()}
        degradation, latency_s = drawn["image_degradation"], drawn["camera_latency_s"]
        faults = sim.image_faults or ImageCorruption()
        return RenderSetup(sim.pool, plan, sim.lens, faults, degradation, int(sim.cameras.image_seeds[0]), latency_s)

    def _render_request(self) -> RenderRequest:
        from tral_env.twin.camera import RenderRequest

        sim = self._world.sim
        mounting = sim.cameras.mounting(np.array([0]))[0]
        return RenderRequest(time.monotonic_ns(), sim.physics.qpos[0].copy(), mounting)
