"""The only stepper: n cars, each in its own corridor, on MuJoCo's batch.

Row i never depends on the other rows: a car alone is a batch of one and drives bit for bit as it does among others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from tral_env.actuation import Actuation, ActuatorInputs
from tral_env.config import CameraConfig, CarConfig, HallConfig, UltrasonicConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool, build_model, place, pool_geoms
from tral_env.errors import ConfigError, SimulationError
from tral_env.interface import CONTROL_PERIOD_S, STEERING, THROTTLE, Layout
from tral_env.noise import NoiseTape
from tral_env.perception.camera_pipeline import Sightings
from tral_env.perception.degrade import WebcamLaw
from tral_env.sensors import ultrasonic
from tral_env.sensors.extras import Extras
from tral_env.sensors.hall import UPDATE_DRAWS, Hall
from tral_env.sensors.ranging import BORESIGHT, SONARS, Ranging
from tral_env.simulation.culling import Window
from tral_env.simulation.handles import CarHandles
from tral_env.simulation.vision import ProjectedVision, RenderedVision, Vision

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]

_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)
_NONE = int(mujoco.mjtStage.mjSTAGE_NONE)

_UNSTABLE = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
"""Warnings about positions, velocities and accelerations that are not finite, or huge."""

STEERING_LEAD_STEPS = 0.8
"""By how many of its steps the semi-implicit integrator turns the car too early; the servo is held back as much.

Measured against steps of 0.25 ms, see tests/car: it halves the error in place and leaves a third of that in heading.
"""

_SONAR_DRAWS = 2 + ultrasonic.MEASURE_DRAWS
"""Numbers for one ranging: softness of the incidence limit, crosstalk, measurement."""


class Simulation:
    """n cars in n corridors: physics, actuation, sensors, eyes."""

    def __init__(
        self,
        n: int,
        pool: Pool,
        *,
        layout: Layout,
        camera: str = "projected",
        car: CarConfig | None = None,
        lens: CameraConfig | None = None,
        nthread: int = 1,
        near: int = 0,
        image_faults: WebcamLaw | None = None,
    ) -> None:
        """Compile the model and bind what is read and written.

        Args:
            n: number of cars.
            pool: how many walls and markers a corridor may have at the most.
            layout: the readings that are wanted.
            camera: "projected" or "rendered".
            car: geometry of the car.
            lens: its camera.
            nthread: threads that step the cars.
            near: how many boxes may be near a car, if that may be more than in the families of courses, see `crowd`.
            image_faults: how much of each fault a level of degradation brings to a rendered image.
        """
        self.n, self.pool, self.layout = n, pool, layout
        self.car, self.lens = car or CarConfig(), lens or CameraConfig()
        self.sonar = UltrasonicConfig()
        self._window = Window(n, pool.boxes, near)
        around = Pool(self._window.size)
        self.model = build_model(around, looks=False)
        self.handles = CarHandles(self.model, self.sonar)
        self._boxes = pool_geoms(self.model, around)
        self.batch = Batch(self.model, n, nthread, True)
        self.substeps = round(CONTROL_PERIOD_S / self.model.opt.timestep)
        self.actuation = Actuation(n, car=self.car, lead_s=STEERING_LEAD_STEPS * self.model.opt.timestep)
        self.hall = Hall(n, HallConfig())
        self.ranging = Ranging(n)
        self.sightings = Sightings(n, self.lens.rate_hz)
        self.noise = NoiseTape(n)
        self.extras = Extras(n, layout, self.noise)
        self.vision: Vision = (
            RenderedVision(n, pool, self.lens, self.car, image_faults)
            if camera == "rendered"
            else ProjectedVision(n, self.noise, self.lens, self.car)
        )
        self.command = np.zeros((n, 2))
        """(n, 2) last command, as applied."""
        self.time_s = np.zeros(n)
        """(n,) time since reset."""
        self.pose = np.zeros((n, 3))
        """(n, 3) true x, y [m], yaw [rad] of the cars."""
        self.speed = np.zeros(n)
        """(n,) true speed along the car's x axis, m/s."""
        self.collision = np.zeros(n, bool)
        """(n,) whether the car touches anything but the floor."""
        self.closing_speed = np.zeros(n)
        """(n,) speed towards what it touches, a tick before, m/s."""
        self.exposures = np.zeros(n, np.int64)
        """(n,) images exposed since reset."""
        self.image_seeds = np.zeros(n, np.int64)
        """(n,) seeds of the noise in the images."""
        self.parameters: dict[str, Array] = {}
        """Drawn parameters of the cars, name -> (n,); see `Randomization`."""
        self._plans: list[Plan | None] = [None] * n
        self._ticks = np.zeros(n, np.int64)
        self._last_fired = np.zeros((n, len(SONARS)))
        self._velocity = np.zeros((n, 2))
        self._wheel = np.zeros(n)
        self._everyone = np.arange(n)
        self._bind()

    def _bind(self) -> None:
        bind, expand = self.batch.bind, self.batch.expand
        self.qpos, self._qvel, self._ctrl = bind("qpos"), bind("qvel"), bind("ctrl")
        self._sensordata, self._history = bind("sensordata"), bind("history")
        self._warnings = self.batch.warning
        self._geom = {name: expand(name) for name in ("geom_pos", "geom_quat", "geom_size", "geom_friction")}
        self._mass, self._inertia = expand("body_mass"), expand("body_inertia")
        self._frictionloss, self._interval = expand("dof_frictionloss"), expand("sensor_interval")

    def plan(self, row: int) -> Plan:
        """Course of a car.

        Raises:
            ConfigError: it has none yet.
        """
        plan = self._plans[row]
        if plan is None:
            raise ConfigError("there is no course before the first reset()")
        return plan

    def reset(
        self,
        rows: Index,
        plans: Sequence[Plan],
        cars: Sequence[Mapping[str, float]],
        rngs: Sequence[np.random.Generator],
    ) -> None:
        """Put cars at the start of their courses.

        Args:
            rows: (k,) which cars.
            plans: k courses.
            cars: k draws of `Randomization`.
            rngs: generators of all n rows, for the noise.
        """
        for row, plan, car in zip(rows, plans, cars, strict=True):
            self._plans[row] = plan
            self._window.place(int(row), place(plan, self.pool))
            self.image_seeds[row] = rngs[row].integers(2**32)
            self.vision.place(int(row), plan, car["image_degradation"], int(self.image_seeds[row]))
            self.noise.reset(int(row), rngs[row])
            self.extras.place(int(row), plan.tape)
        for name in cars[0]:
            if name not in self.parameters:
                self.parameters[name] = np.zeros(self.n)
            self.parameters[name][rows] = [car[name] for car in cars]
        self._outfit(rows)
        self._surround(rows, np.array([plan.start[:2] for plan in plans]))
        self.batch.reset(rows, stage=_NONE)
        self._park(rows, plans)
        self.time_s[rows] = 0.0
        self._ticks[rows] = 0
        self.command[rows] = 0.0
        self.exposures[rows] = 0
        self.actuation.reset(rows)
        self.hall.reset(rows)
        self.sightings.reset(rows, self.parameters["camera_latency_s"][rows])
        self._first_ranges(rows)
        self._observe_truth()
        self._wheel[rows] = self._sensordata[rows, self.handles.hall_wheel]
        self._look(rows)
        self.extras.battery_v[rows] = self.parameters["battery_v"][rows]
        self.extras.update(rows, self.pose, self._at_rest())

    def _surround(self, rows: Index, position: Array) -> None:
        """Put the boxes near the cars into their models. Without `set_const` rays and contacts would miss them."""
        for name, values in zip(("geom_pos", "geom_quat", "geom_size"), self._window.look(rows, position), strict=True):
            self._geom[name][rows[:, None], self._boxes] = values
        self.batch.set_const(rows)

    def _outfit(self, rows: Index) -> None:
        """Give cars the bodies, tyres and actuators that were drawn for them."""
        drawn = {name: values[rows] for name, values in self.parameters.items()}
        handles, model = self.handles, self.model
        bodies = handles.car_bodies
        self._mass[rows[:, None], bodies] = model.body_mass[bodies] * drawn["mass_scale"][:, None]
        self._inertia[rows[:, None], bodies] = model.body_inertia[bodies] * drawn["mass_scale"][:, None, None]
        self._geom["geom_friction"][rows[:, None], handles.tyres, 0] = drawn["friction"][:, None]
        for sonar in range(len(SONARS)):
            self._interval[rows[:, None], handles.rays[sonar], 0] = drawn["sonar_cadence_s"][:, None]
        parameters = self.actuation.parameters
        parameters.mechanism_offset[rows] = np.radians(drawn["mechanism_offset_deg"])
        parameters.steering_offset[rows] = np.radians(drawn["steering_offset_deg"])
        for name in ("lock_scale", "servo_speed_scale", "servo_strength_scale", "latency_s", "battery_v"):
            getattr(parameters, name)[rows] = drawn[name]
        parameters.battery_resistance[rows] = drawn["battery_resistance_ohm"]

    def _park(self, rows: Index, plans: Sequence[Plan]) -> None:
        start = np.array([plan.start for plan in plans])
        root = self.handles.root_qpos
        self.qpos[rows, root : root + 2] = start[:, :2]
        self.qpos[rows, root + 3] = np.cos(start[:, 2] / 2)
        self.qpos[rows, root + 6] = np.sin(start[:, 2] / 2)

    def _at_rest(self) -> Array:
        """(n, 6) what the inertial sensors of standing cars feel; MuJoCo's have not been read before the first tick."""
        motion = np.zeros((self.n, len(self.handles.imu)))
        motion[:, 5] = -self.model.opt.gravity[2]
        return motion

    def _first_ranges(self, rows: Index) -> None:
        """Range once at time 0; then the sonars fire in turn, or together, each in its cadence."""
        self.batch.forward(rows, stage=_VEL)
        self._observe_truth()
        count = len(SONARS)
        row, sonar = np.repeat(rows, count), np.tile(np.arange(count), len(rows))
        self.ranging.reset(rows, self._measure(row, sonar, np.zeros(len(row))).reshape(-1, count))
        cadence = self.parameters["sonar_cadence_s"][rows, None]
        together = self.parameters["sonar_together"][rows, None] > 0.5
        wait = np.where(together, 1.0, (np.arange(count) + 1.0) / count) * cadence
        for k in range(count):
            self._history[rows[:, None], self.handles.ray_clocks[k]] = (wait - cadence)[:, k, None]
        self._last_fired[rows] = wait - cadence

    def step(self, command: Array, rows: Index | None = None) -> None:
        """Drive for one control period.

        Args:
            command: (n, 2) steering, throttle; clipped to [-1, 1].
            rows: (k,) the cars that move; None: all.

        Raises:
            SimulationError: the physics of a car became unstable; it has to be reset.
        """
        moving = self._everyone if rows is None else rows
        self.command[moving] = np.minimum(np.maximum(command[moving], -1.0), 1.0)
        drive = self.actuation.apply(moving, self.command[moving], self._wheel_speed()[moving])
        self._actuate(moving, drive)
        if len(far := self._window.due(self.pose[:, :2])):
            self._surround(far, self.pose[far, :2])
        self.batch.step(rows, nstep=self.substeps, stage=_VEL)
        self._check_stable()
        self._ticks[moving] += 1
        self.time_s[moving] = self._ticks[moving] * CONTROL_PERIOD_S
        before = self._velocity.copy()
        self._observe_truth()
        self._feel_contact(before)
        self._count_ticks(moving)
        self._fire_sonars()
        self._look(moving)
        self.extras.update(moving, self.pose, self._sensordata[:, self.handles.imu])

    def _check_stable(self) -> None:
        # MuJoCo itself only counts a warning and puts such a car back to the origin, as if nothing had happened.
        unstable = self._warnings[:, _UNSTABLE, 1]
        if unstable.any():
            raise SimulationError(f"unstable physics in rows {np.flatnonzero(unstable.any(axis=1)).tolist()}")

    def _wheel_speed(self) -> Array:
        """(n,) mean rate of the four wheels times their radius, m/s; a sum in fixed order, alike for any n."""
        a, b, c, d = (self._sensordata[:, wheel] for wheel in self.handles.wheel_speeds)
        speed: Array = (a + b + c + d) * (self.car.wheel_radius / 4)
        return speed

    def _actuate(self, rows: Index, drive: ActuatorInputs) -> None:
        handles = self.handles
        self._ctrl[rows, handles.steer_actuator] = drive.steering_angle
        self._ctrl[rows, handles.drive_actuator] = drive.voltage
        self._frictionloss[rows, handles.steer_dof] = drive.scrub_torque
        self.extras.battery_v[rows] = drive.battery_v

    def _observe_truth(self) -> None:
        root = self.handles.root_qpos
        w, z = self.qpos[:, root + 3], self.qpos[:, root + 6]
        x, y = self.qpos[:, root + 4], self.qpos[:, root + 5]
        yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        self.pose[:, 0], self.pose[:, 1], self.pose[:, 2] = self.qpos[:, root], self.qpos[:, root + 1], yaw
        dof = self.handles.root_dof
        self._velocity[:] = self._qvel[:, dof : dof + 2]
        self.speed[:] = self._velocity[:, 0] * np.cos(yaw) + self._velocity[:, 1] * np.sin(yaw)

    def _feel_contact(self, before: Array) -> None:
        found = self._sensordata[:, self.handles.contact_found]
        normal = self._sensordata[:, self.handles.contact_normal]
        self.collision[:] = found > 0
        towards = np.abs(before[:, 0] * normal[:, 0] + before[:, 1] * normal[:, 1])
        self.closing_speed[:] = np.where(self.collision, towards, 0.0)

    def _count_ticks(self, moving: Index) -> None:
        wheel = self._sensordata[:, self.handles.hall_wheel]
        travel = (wheel - self._wheel) * self.car.wheel_radius / self.parameters["wheel_radius_scale"]
        self._wheel[:] = wheel
        uniform = np.zeros((self.n, UPDATE_DRAWS))
        uniform[moving] = self.noise.uniform(moving, UPDATE_DRAWS)
        rates = self.parameters["hall_miss_rate"], self.parameters["hall_double_rate"]
        self.hall.update(travel, self.time_s, CONTROL_PERIOD_S, uniform, *rates)

    def _fire_sonars(self) -> None:
        fired_at = self._history[:, self.handles.sonar_clocks]
        rows, sonars = np.nonzero(fired_at > self._last_fired)
        if not len(rows):
            return
        time_s = fired_at[rows, sonars]
        self._last_fired[rows, sonars] = time_s
        self.ranging.fire(rows, sonars, self._measure(rows, sonars, self.time_s[rows] - time_s), time_s)

    def _measure(self, rows: Index, sonars: Index, since_s: Array) -> Array:
        """Ranges of the named sonars, from rays cast `since_s` ago; (k,). The rows ascend, some more than once."""
        fan = self._sensordata[rows[:, None], self.handles.fans[sonars]].reshape(len(rows), self.sonar.rays, 4)
        yaw_rate = self._qvel[rows, self.handles.root_dof + 5]
        angle = self.pose[rows, 2] - yaw_rate * since_s + BORESIGHT[sonars]
        cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
        normal = np.empty((*fan.shape[:2], 2))
        normal[..., 0] = cos * fan[..., 1] + sin * fan[..., 2]
        normal[..., 1] = cos * fan[..., 2] - sin * fan[..., 1]
        first = np.append(True, rows[1:] != rows[:-1])
        row, place = rows[first], first.cumsum() - 1
        # A row takes the numbers of all its sonars at once, whichever fired.
        uniform = self.noise.uniform(row, _SONAR_DRAWS * len(SONARS)).reshape(len(row), len(SONARS), _SONAR_DRAWS)
        mine = uniform[place, sonars]
        echoes = np.full((len(SONARS), len(row)), np.inf)
        echoes[sonars, place] = ultrasonic.echo(fan[..., 0], normal, self.sonar, mine[:, 0])
        if (together := self.parameters["sonar_together"][row] > 0.5).any():
            echoes = ultrasonic.crosstalk(echoes, uniform[:, :, 1].T, together, self.sonar)
        outliers = self.parameters["sonar_outlier_rate"][rows]
        return ultrasonic.measure(echoes[sonars, place], mine[:, 2:], self.sonar, outliers)

    def _look(self, moving: Index) -> None:
        rows = self.sightings.due(moving, self.time_s)
        if len(rows):
            seen = self.vision.see(rows, self.pose[rows], self.qpos[rows], self.mounting(rows))
            self.sightings.expose(rows, self.time_s, seen)
            self.exposures[rows] += 1
        self.sightings.deliver(self.time_s)

    def mounting(self, rows: Index) -> Array:
        """(k, 3) roll, pitch, yaw of the cameras' mounting errors, rad."""
        degrees = [self.parameters[f"camera_{axis}_deg"][rows] for axis in ("roll", "pitch", "yaw")]
        return np.radians(np.stack(degrees, axis=1))

    def observation(self) -> NDArray[np.float32]:
        """What the policies are told now, (n, d)."""
        values: dict[str, Array] = {
            "distance": self.hall.distance,
            "speed": self.hall.speed,
            "steering": self.command[:, STEERING],
            "throttle": self.command[:, THROTTLE],
            **self.sightings.readings(self.time_s),
            **self.extras.readings,
        }
        age = self.ranging.age(self.time_s)
        for i, side in enumerate(SONARS):
            values[f"ultrasonic_{side}"] = self.ranging.range_m[:, i]
            values[f"ultrasonic_{side}_age"] = age[:, i]
        return self.layout.pack(values, self.n)

    def close(self) -> None:
        """Free what OpenGL holds."""
        self.vision.close()
