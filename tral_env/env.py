"""One car in one corridor, as Gymnasium environments."""

from __future__ import annotations

import inspect
import math
from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from tral_env.course.layout import Course
from tral_env.course.plan import Plan
from tral_env.errors import ConfigError, nearest
from tral_env.interface import CONTROL_RATE_HZ, CORE_LAYOUT, action_space
from tral_env.options import CorridorConfig, check_counts, is_count, option_parameters, takes
from tral_env.world import VIEWS, Simulation, Views, Webcam, World

_ROW = np.zeros(1, np.int64)


@takes(option_parameters())
class TralCorridorEnv(gym.Env[Any, Any], EzPickle):
    """A 1:10 car drives a university corridor by three ultrasonics, a hall sensor and a camera.

    ## Action
    `Box(-1, 1, (2,), float32)`, 80 times a second: steering (+1 = full left, 22 degrees), throttle (+1 = full forward,
    0 = neutral). Throttle below 0 brakes while the car rolls forward; it reverses only after the ESC's neutral.

    ## Observation
    `Box((d,), float32)`, SI units, frame x forward, y left; each reading with its age, because a sonar answers 8 to
    15 times a second and a camera 15 times.

    {fields}

    ## Reward
    Progress along the route in metres (1 a metre: the slope to climb), 1 for a gate passed, 5 for the goal, -2 for
    a collision or a missed gate, minus 0.01 times the square of the steering's change and 0.005 a tick.
    Numbers: `TaskConfig`. `info["reward_terms"]` has each term by name: `progress`, `gate`, `success`, `failure`,
    `steering`, `time`; the reward is their sum.

    ## Start, end
    The car stands in the middle third of the corridor, within 5 degrees of its direction. *Terminated*: the rear axle
    crosses the goal line after all gates in order (success); any contact with wall, door, obstacle or post
    (collision); a gate crossed outside its posts or backwards (missed gate). *Truncated*: the route took longer than
    its length / (0.3 m/s) + 10 s.

    ## Info
    Ground truth that no policy sees: `success`, `collision`, `crash` (closing speed of 0.2 m/s or more), `missed_gate`,
    `progress` in [0, 1], `gates_passed`, `gates_total`, `clearance_left_m` and `clearance_right_m` (from the side
    ultrasonics square to the walls; absent off the plain straights), `lateral_offset_m` to the route, `pose` (x, y [m],
    yaw [rad]), `speed_mps`, `time_s`; `is_success` when the episode ends; `car` at reset: the drawn parameters.

    ## Arguments
    See `CorridorConfig`. `render_mode="rgb_array"` with `view` "chase", "top" or "onboard".
    `reset(options={{"course": Course or path, "car": {{"friction": 0.6}}}})`.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": int(CONTROL_RATE_HZ)}  # noqa: RUF012 (Gymnasium declares it so)

    _pixels: ClassVar[bool] = False
    """The observation has an image."""

    def __init__(
        self,
        *,
        render_mode: str | None = None,
        view: str = "chase",
        width: int = 640,
        height: int = 480,
        **options: Any,
    ) -> None:
        EzPickle.__init__(self, render_mode=render_mode, view=view, width=width, height=height, **options)
        if render_mode not in (None, "rgb_array"):
            raise ConfigError(f"unknown render_mode {render_mode!r}. Allowed: None, 'rgb_array'")
        if view not in VIEWS:
            raise ConfigError(f"unknown view '{view}': {nearest(view, VIEWS)}")
        check_counts(width=width, height=height)
        self.render_mode, self._view, self._size = render_mode, view, (width, height)
        config = CorridorConfig.of(options, allowed=inspect.signature(type(self)).parameters, pixels=self._pixels)
        self.world = World(1, config)
        self.action_space = action_space()
        self.observation_space: spaces.Space[Any] = self.world.layout.space()
        self._views = Views()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start a new episode; see the class for the options."""
        super().reset(seed=seed)
        car = self.world.reset(_ROW, [self.np_random], options)
        info = self._info(self.world.info())
        info["car"] = {name: float(values[0]) for name, values in car.items()}
        return self._observation(self.world.observation()[0]), info

    def step(self, action: NDArray[np.floating]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for 12.5 ms.

        Raises:
            ConfigError: the action is not two finite numbers.
        """
        action = np.asarray(action, np.float64)
        if action.shape != (2,) or not np.isfinite(action).all():
            raise ConfigError(f"action {action!r}: expected two finite numbers: steering, throttle")
        step = self.world.step(action[None])
        info = self._info(step.info)
        info["reward_terms"] = {name: values.item() for name, values in step.reward_terms.items()}
        terminated, truncated = bool(step.terminated[0]), bool(step.truncated[0])
        if terminated or truncated:
            info["is_success"] = info["success"]
        return self._observation(step.observation[0]), float(step.reward[0]), terminated, truncated, info

    def _observation(self, readings: NDArray[np.float32]) -> Any:
        return readings

    def _info(self, info: dict[str, Any]) -> dict[str, Any]:
        """Info of the only car: Python numbers and bools, and arrays of its own."""
        single = {name: values.item() if values.ndim == 1 else values[0].copy() for name, values in info.items()}
        # Not NaN, which is unequal to itself: Gymnasium's checker would call the env not deterministic.
        for name in ("clearance_left_m", "clearance_right_m"):
            if math.isnan(single[name]):
                del single[name]
        return single

    @property
    def plan(self) -> Plan:
        """Geometry of the course being driven."""
        plan = self.world.plans[0]
        if plan is None:
            raise ConfigError("there is no course before the first reset()")
        return plan

    @property
    def course(self) -> Course:
        """The course being driven."""
        course = self.world.courses[0]
        if course is None:
            raise ConfigError("there is no course before the first reset()")
        return course

    def render(self) -> NDArray[np.uint8] | None:
        """The chosen view, (height, width, 3) uint8; None without a render mode."""
        return None if self.render_mode is None else self.render_view(self._view, *self._size)

    def render_view(self, view: str, width: int = 640, height: int = 480) -> NDArray[np.uint8]:
        """Any view at any time.

        Args:
            view: "chase", "top" or "onboard".
            width: px.
            height: px.

        Raises:
            ConfigError: unknown view.
            RenderError: no OpenGL on this machine.
        """
        return self._views.render(self.world.sim, view, 0, width, height)

    def close(self) -> None:
        """Free what OpenGL holds."""
        self.world.close()
        self._views.close()


if TralCorridorEnv.__doc__:  # absent under python -OO
    TralCorridorEnv.__doc__ = TralCorridorEnv.__doc__.format(fields=CORE_LAYOUT.table().replace("\n", "\n    "))


@takes(inspect.signature(TralCorridorEnv).parameters.values())
class TralCorridorPixelsEnv(TralCorridorEnv):
    """`TralCorridor-v0` with the camera's image in the observation.

    Observation: `Dict(image=Box(0, 255, (height, width, 3), uint8), readings=Box((d,), float32))`. The image is that of
    the last exposure, 15 times a second, scaled to `image_size`, (width, height) in pixels: through the lens, with the
    mounting error and the degradation that were drawn for the car. It needs OpenGL. `image_faults` are in the image
    with either camera; the readings of the projected one know nothing of them.
    """

    _pixels: ClassVar[bool] = True

    def __init__(self, *, image_size: Sequence[int] = (160, 120), **options: Any) -> None:
        super().__init__(**options)
        EzPickle.__init__(self, image_size=image_size, **options)
        if np.shape(image_size) != (2,) or not all(map(is_count, image_size)):
            raise ConfigError(f"image_size = {image_size!r}: expected width and height, px, such as (160, 120)")
        width, height = self._image_size = tuple(image_size)
        image = spaces.Box(0, 255, (height, width, 3), np.uint8)
        self.observation_space = spaces.Dict({"image": image, "readings": self.world.layout.space()})
        self._image = np.zeros(image.shape, np.uint8)
        self._exposures = -1
        self._sim: Simulation | None = None
        self._webcam: Webcam | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start a new episode, with a new image."""
        self._exposures = -1
        return super().reset(seed=seed, options=options)

    def _observation(self, readings: NDArray[np.float32]) -> Any:
        sim = self.world.sim
        webcam = self._webcam
        if self._exposures < 0 or webcam is None:
            webcam = self._place_webcam(sim)
        exposures = int(sim.exposures[0])
        if exposures != self._exposures:
            self._exposures = exposures
            self._image = webcam.image(0, sim.qpos[0], sim.mounting(_ROW)[0])
        return {"image": self._image.copy(), "readings": readings}

    def _place_webcam(self, sim: Simulation) -> Webcam:
        webcam = self._webcam
        if webcam is None or sim is not self._sim:
            if webcam is not None:
                webcam.close()
            faults = self.world.config.image_faults.scaled(self._image_size[0] / sim.lens.width)
            webcam = Webcam(1, sim.pool, sim.lens.scaled(*self._image_size), faults)
            self._webcam, self._sim = webcam, sim
        degradation = float(sim.parameters["image_degradation"][0])
        webcam.place(0, sim.plan(0), degradation, int(sim.image_seeds[0]))
        return webcam

    def close(self) -> None:
        """Free what OpenGL holds."""
        super().close()
        if self._webcam is not None:
            self._webcam.close()
