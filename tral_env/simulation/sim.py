"""The only stepper: n cars, each in its own corridor, on MuJoCo's batch.

Row i never depends on the other rows: a car alone is a batch of one and drives bit for bit as it does among others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Array, Index, Rows, everyone
from tral_env.checks import one_of
from tral_env.config import CameraConfig, CarConfig, UltrasonicConfig
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool
from tral_env.errors import ConfigError
from tral_env.interface import STEERING, THROTTLE, Layout
from tral_env.noise import NoiseTape
from tral_env.perception.degrade import ImageCorruption
from tral_env.perception.false_sightings import FalseSightings
from tral_env.randomization import LEVELS
from tral_env.se2 import rotate
from tral_env.sensors.optional import OptionalReadings
from tral_env.simulation.actuators import Actuators
from tral_env.simulation.cameras import Cameras
from tral_env.simulation.hall_wheel import HallWheel
from tral_env.simulation.parameters import CarParameters
from tral_env.simulation.physics import Physics
from tral_env.simulation.pixels import Pixels
from tral_env.simulation.sonars import Sonars
from tral_env.simulation.truth import GroundTruth
from tral_env.simulation.vision import ProjectedVision, RenderedVision, Vision

CHANGEABLE = ("friction", "battery_v", "latency_s", "steering_offset_deg")
"""Parameters of `Randomization` that may change while a car drives."""


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
        image_size: tuple[int, int] | None = None,
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
            image_size: width and height of the images that are observed, px; None: none are.
        """
        self.n, self.pool, self.layout = n, pool, layout
        self.car, self.lens, self.image_faults = car or CarConfig(), lens or CameraConfig(), image_faults
        self._everyone = everyone(n)
        self._plans: list[Plan | None] = [None] * n
        sonar, noise = UltrasonicConfig(), NoiseTape(n)
        self._noise = noise
        self.physics = Physics(n, pool, sonar, nthread=nthread, near=near)
        self.actuators = Actuators(n, self.car, self.physics)
        self.car_parameters = CarParameters(n, self.physics, self.actuators.actuation)
        self.truth = GroundTruth(n, self.physics)
        self.hall_wheel = HallWheel(n, self.car, self.physics, self.car_parameters, noise)
        self.sonars = Sonars(n, sonar, self.physics, self.truth, self.car_parameters, noise)
        self.optional = OptionalReadings(n, layout, noise)
        vision = self._vision(camera, image_faults)
        false_sightings = FalseSightings(n, self.lens, self.car)
        pixels = None if image_size is None else Pixels(n, image_size, pool, self.lens, image_faults)
        self.cameras = Cameras(
            n, self.lens.rate_hz, vision, false_sightings, self.physics, self.truth, self.car_parameters, pixels
        )
        self.time_s, self.command, self.pose = self.physics.time_s, self.actuators.command, self.truth.pose
        """Arrays of the parts, which write them in place."""

    def _vision(self, camera: str, image_faults: ImageCorruption | None) -> Vision:
        if camera == "rendered":
            return RenderedVision(self.n, self.pool, self.lens, self.car, image_faults)
        return ProjectedVision(self.n, self._noise, self.lens, self.car)

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
        self.optional.update(
            rows, self.pose, self.physics.motion_at_rest(), self.car_parameters.drawn["battery_v"][rows]
        )

    def _place(self, row: int, plan: Plan, degradation: float, rng: np.random.Generator) -> None:
        """Put a course around a car. The order matters: all take their numbers from one generator."""
        self._plans[row] = plan
        self.physics.place(row, plan)
        self.cameras.place(row, plan, degradation, rng)
        self._noise.reset(row, rng)
        self.optional.place(row, plan.tape)

    def step(self, command: Array, rows: Index | None = None) -> None:
        """Drive for one control period.

        Args:
            command: (n, 2) steering, throttle; clipped to [-1, 1].
            rows: (k,) the cars that move; None: all.

        Raises:
            SimulationError: the physics of a car became unstable; it has to be reset.
        """
        moving: Rows = self._everyone if rows is None else rows
        battery_v = self.actuators.apply(moving, command)
        self.physics.step(moving, rows, self.pose[:, :2])
        self.truth.update()
        self.hall_wheel.update(moving)
        self.sonars.update()
        self.cameras.update(moving)
        if self.optional.groups:
            self.optional.update(moving, self.pose, self.physics.motion(), battery_v)

    def push(self, row: int, forward: float, left: float) -> None:
        """Shove a car: add to its velocity, m/s along its own axes."""
        yaw, root = float(self.pose[row, 2]), self.physics.handles.root_dof
        self.physics.qvel[row, root : root + 2] += rotate(np.cos(yaw), np.sin(yaw), forward, left)

    def change(self, row: int, **values: float) -> None:
        """Change parameters of a car while it drives.

        Args:
            row: which car.
            values: each of `CHANGEABLE` by name.

        Raises:
            ConfigError: another name, or a value that no car has.
        """
        for name in values:
            one_of("parameter", name, CHANGEABLE)
        LEVELS["none"].fixed(**values)
        drawn = {name: float(each[row]) for name, each in self.car_parameters.drawn.items()}
        self.car_parameters.apply(np.array([row]), [{**drawn, **values}])

    def images(self) -> NDArray[np.uint8]:
        """The last images that have arrived, (n, height, width, 3).

        Raises:
            ConfigError: no images are observed.
        """
        if self.cameras.pixels is None:
            raise ConfigError("no images are observed: expected TralCorridorPixels-v0")
        return self.cameras.pixels.images.copy()

    def observation(self) -> NDArray[np.float32]:
        """What the policies are told now, (n, d)."""
        values: dict[str, Array] = {
            **self.hall_wheel.readings(),
            "steering": self.command[:, STEERING],
            "throttle": self.command[:, THROTTLE],
            **self.cameras.readings(),
            **self.optional.readings(),
            **self.sonars.readings(),
        }
        return self.layout.pack(values, self.n)

    def close(self) -> None:
        """Free what OpenGL holds."""
        self.cameras.close()
