"""The only stepper: n cars, each in its own corridor, on MuJoCo's batch.

Row i never depends on the other rows: a car alone is a batch of one and drives bit for bit as it does among others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from tral_env.config import CameraConfig, CarConfig, UltrasonicConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool
from tral_env.errors import ConfigError
from tral_env.interface import STEERING, THROTTLE, Layout
from tral_env.noise import NoiseTape
from tral_env.perception.degrade import ImageCorruption
from tral_env.perception.false_sightings import FalseSightings
from tral_env.sensors.extras import Extras
from tral_env.simulation.actuators import Actuators
from tral_env.simulation.cameras import Cameras
from tral_env.simulation.hall_wheel import HallWheel
from tral_env.simulation.parameters import CarParameters
from tral_env.simulation.physics import Physics
from tral_env.simulation.sonars import Sonars
from tral_env.simulation.truth import GroundTruth
from tral_env.simulation.vision import ProjectedVision, RenderedVision, Vision

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Simulation:
    """n cars in n corridors: command -> actuators -> physics -> truth -> sensors and cameras -> observation."""

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
        image_faults: ImageCorruption | None = None,
    ) -> None:
        """Compile the model and put the parts together.

        Args:
            n: number of cars.
            pool: how many walls and markers a corridor may have at the most.
            layout: the readings that are wanted.
            camera: "projected" or "rendered".
            car: geometry of the car.
            lens: its camera.
            nthread: threads that step the cars.
            near: how many boxes may be near a car, if that may be more than in the families of courses, see
                `max_boxes_in_reach`.
            image_faults: how much of each fault a level of degradation brings to a rendered image.
        """
        self.n, self.pool, self.layout = n, pool, layout
        self.car, self.lens, self.image_faults = car or CarConfig(), lens or CameraConfig(), image_faults
        self._rows = np.arange(n)
        self._plans: list[Plan | None] = [None] * n
        sonar, noise = UltrasonicConfig(), NoiseTape(n)
        self._noise = noise
        self.physics = Physics(n, pool, sonar, nthread=nthread, near=near)
        self.actuators = Actuators(n, self.car, self.physics)
        self.car_parameters = CarParameters(n, self.physics, self.actuators.actuation)
        self.truth = GroundTruth(n, self.physics)
        self.hall_wheel = HallWheel(n, self.car, self.physics, self.car_parameters, noise)
        self.sonars = Sonars(n, sonar, self.physics, self.truth, self.car_parameters, noise)
        self.extras = Extras(n, layout, noise)
        vision = self._vision(camera, image_faults)
        false_sightings = FalseSightings(n, self.lens, self.car)
        self.cameras = Cameras(
            n, self.lens.rate_hz, vision, false_sightings, self.physics, self.truth, self.car_parameters
        )
        self._share_arrays()

    def _vision(self, camera: str, image_faults: ImageCorruption | None) -> Vision:
        if camera == "rendered":
            return RenderedVision(self.n, self.pool, self.lens, self.car, image_faults)
        return ProjectedVision(self.n, self._noise, self.lens, self.car)

    def _share_arrays(self) -> None:
        """The parts' arrays under short names; their owners write them in place and document them."""
        self.qpos, self.time_s = self.physics.qpos, self.physics.time_s
        self.command, self.parameters = self.actuators.command, self.car_parameters.drawn
        self.pose, self.speed = self.truth.pose, self.truth.speed
        self.collision, self.closing_speed = self.truth.collision, self.truth.closing_speed
        self.exposures, self.image_seeds = self.cameras.exposures, self.cameras.image_seeds

    @property
    def batch(self) -> Batch:
        """MuJoCo's batch, which steps the cars."""
        return self.physics.batch

    @property
    def substeps(self) -> int:
        """Steps of the physics in a control period."""
        return self.physics.substeps

    @property
    def vision(self) -> Vision:
        """The way the cars see."""
        return self.cameras.vision

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
            self._place(int(row), plan, car["image_degradation"], rngs[row])
        self.car_parameters.apply(rows, cars)
        self.physics.reset(rows, plans)
        self.truth.reset(rows)
        self.actuators.reset(rows)
        self.hall_wheel.reset(rows)
        self.sonars.reset(rows)
        self.cameras.reset(rows)
        self.extras.battery_v[rows] = self.parameters["battery_v"][rows]
        self.extras.update(rows, self.pose, self.physics.motion_at_rest())

    def _place(self, row: int, plan: Plan, degradation: float, rng: np.random.Generator) -> None:
        """Put a course around a car. The order matters: all take their numbers from one generator."""
        self._plans[row] = plan
        self.physics.place(row, plan)
        self.cameras.place(row, plan, degradation, rng)
        self._noise.reset(row, rng)
        self.extras.place(row, plan.tape)

    def step(self, command: Array, rows: Index | None = None) -> None:
        """Drive for one control period.

        Args:
            command: (n, 2) steering, throttle; clipped to [-1, 1].
            rows: (k,) the cars that move; None: all.

        Raises:
            SimulationError: the physics of a car became unstable; it has to be reset.
        """
        moving = self._rows if rows is None else rows
        self.extras.battery_v[moving] = self.actuators.apply(moving, command)
        self.physics.step(moving, rows, self.pose[:, :2])
        self.truth.update()
        self.hall_wheel.update(moving)
        self.sonars.update()
        self.cameras.update(moving)
        self.extras.update(moving, self.pose, self.physics.motion())

    def mounting(self, rows: Index) -> Array:
        """(k, 3) roll, pitch, yaw of the cameras' mounting errors, rad."""
        return self.cameras.mounting(rows)

    def observation(self) -> NDArray[np.float32]:
        """What the policies are told now, (n, d)."""
        values: dict[str, Array] = {
            **self.hall_wheel.readings(),
            "steering": self.command[:, STEERING],
            "throttle": self.command[:, THROTTLE],
            **self.cameras.readings(),
            **self.extras.readings,
            **self.sonars.readings(),
        }
        return self.layout.pack(values, self.n)

    def close(self) -> None:
        """Free what OpenGL holds."""
        self.vision.close()
