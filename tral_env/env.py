"""One car in one corridor, as Gymnasium environments."""

from __future__ import annotations

import inspect
import math
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from tral_env.arrays import number
from tral_env.checks import is_seed
from tral_env.course.layout import Course
from tral_env.course.plan import Plan
from tral_env.decisions import Decisions
from tral_env.errors import ConfigError
from tral_env.human import open_human_view
from tral_env.interface import CONTROL_RATE_HZ, CORE_LAYOUT, action_space, as_command
from tral_env.options import CorridorConfig, JsonSpec, is_count, option_parameters, takes
from tral_env.world import Stills, World, check_pictures

_ROW = np.zeros(1, np.int64)


@takes(option_parameters())
class TralCorridorEnv(JsonSpec, gym.Env[Any, Any], EzPickle):
    """A 1:10 car drives a university corridor with three ultrasonics, a hall sensor and a camera.

    ## Description
    The car is an Ackermann car of 0.4 m, simulated in MuJoCo. It starts in a corridor that is new in every episode,
    passes all gates in order, and reaches the goal line without touching anything. Its readings are noisy,
    late and sometimes wrong, as those of the real car are. Frame: x forward, y left, z up, angles
    counter-clockwise, origin on the ground below the middle of the rear axle. A step takes 1/80 s.

    ## Action Space
    `Box(-1, 1, (2,), float32)`:

    | # | action | min | max | unit | meaning |
    | --- | --- | --- | --- | --- | --- |
    | 0 | `steering` | -1 | 1 | share of full lock | +1 = full left, a steering angle of 22 degrees |
    | 1 | `throttle` | -1 | 1 | share of full throttle | +1 = full forward, 0 = neutral, -1 = full reverse or brake |

    The motor stays off up to a throttle of 0.08 either way. A command takes effect after the car's latency, 0.02 s
    when nothing is randomized. Throttle against the direction of travel brakes. The direction changes only after the
    motor controller has seen 0.1 s of brake and then 0.1 s of neutral. A command beyond the bounds counts as the bound.
    The options `decision_hz`, `action` and `drive_range` hold a command for several ticks, and let the second action
    ask for a speed. Rewards then add up over the ticks, and an episode that ends among them ends the step.

    ## Observation Space
    `Box((d,), float32)` in SI units. A reading keeps its value until the next one arrives. Ranges, gate and marker
    have an age, which tells how old they are: a sonar answers 9 to 15 times a second, the camera 15 times. All else is
    measured in every step.

    {fields}

    The option `groups` adds readings behind these:

    | group | columns | what it is |
    | --- | --- | --- |
    | `line` | 1 | one byte of the line sensor: one bit a photo diode, bit 7 leftmost, 1 = tape |
    | `imu` | 6 | angular rate about x, y, z, rad/s; acceleration with gravity along x, y, z, m/s^2 |
    | `battery` | 1 | voltage of the drive battery under load, V |

    These groups are for learners and for your own code: a state machine sees the core readings only. The options
    `observation="features"`, `history`, `spacing_s` and `growth` make an observation for a network, `Box(-1, 1, (H * F,))`;
    with `memory` the M features of the memory stand behind the H frames.

    ## Rewards
    The reward is the sum of these terms, which `info["reward_terms"]` tells by name. The weights are fields of
    `TaskConfig`, see the option `task`.

    | term | weight | default | formula |
    | --- | --- | --- | --- |
    | `progress` | `progress_reward` | 1 | weight * metres gained along the route in this step; negative backwards |
    | `gate` | `gate_reward` | 1 | weight, when the car passes its next gate |
    | `success` | `success_reward` | 5 | weight, when the car reaches the goal |
    | `failure` | `failure_reward` | -2 | weight, at a collision or a missed gate |
    | `steering` | `steering_cost` | 0.01 | -weight * (change of the steering command in this step)^2 |
    | `time` | `time_cost` | 0.005 | -weight, in every step |

    ## Starting State
    The car stands still, its commands are 0, and it is within a sixth of the corridor's width of the middle line and
    within 5 degrees of the corridor's direction. A course of your own says where its car starts. The ultrasonics have
    just measured once; the camera has just exposed its first image, which arrives after the camera's latency. Course
    and car are drawn from the seed: `reset(seed=k)` always gives the same episode.

    ## Episode End
    ### Termination
    1. Success: the rear axle crosses the goal line after all gates in order.
    2. Collision: the car touches a wall, door, obstacle or post.
    3. Missed gate: the rear axle crosses a gate's plane outside its posts, between them backwards, or between them
       out of order, which a second time through a gate is too; or it crosses the goal line before all gates.

    ### Truncation
    The episode took longer than the route's length / `nominal_speed` (0.3 m/s) + `grace_s` (10 s), both of
    `TaskConfig`. The limit depends on the course, so `spec.max_episode_steps` is None. `info["time_limit_s"]` tells it,
    also at a reset: an episode has `ceil(80 * time_limit_s)` steps at most. `gym.make(..., max_episode_steps=n)`
    adds a second limit; the earlier one truncates.

    ## Info
    Ground truth. No policy sees it.

    | key | unit | when | what it is |
    | --- | --- | --- | --- |
    | `success` | | always | the car reached the goal line after all gates in order and touched nothing |
    | `collision` | | always | the car touches a wall, door, obstacle or post |
    | `crash` | | always | the point of contact moves towards it at 0.2 m/s or more (`touch_speed` of `TaskConfig`) |
    | `missed_gate` | | always | the car missed a gate in this step, see Episode End |
    | `progress` | | always | share of the route's length, 0 to 1 |
    | `gates_passed` | | always | number of gates that the car has passed |
    | `gates_total` | | always | number of gates of the route |
    | `clearance_left_m` | m | beside plain walls | from the left ultrasonic to the wall, square to the wall |
    | `clearance_right_m` | m | beside plain walls | the same on the right |
    | `lateral_offset_m` | m | always | distance from the route, + = the car is left of it |
    | `pose` | m, m, rad | always | x, y, yaw of the car in the course's frame |
    | `speed_mps` | m/s | always | speed along the car's x axis |
    | `time_s` | s | always | time since reset |
    | `time_limit_s` | s | always | `time_s` at which the episode is truncated |
    | `reward_terms` | | steps | the terms of the reward by name; `sum(info["reward_terms"].values())` is the reward |
    | `is_success` | | last step | the same as `success` |
    | `car` | | reset | the drawn parameters of the car by name, see `tral_env.randomization.Randomization` |

    Near doors, corners, gates and obstacles the clearances are absent (NaN in a vector environment).

    ## Arguments
    ```python
    import gymnasium as gym

    env = gym.make("tral_env:TralCorridor-v0", scenario="gates", groups=("imu",))
    ```

    | argument | default | meaning |
    | --- | --- | --- |
    | `render_mode` | `None` | `"rgb_array"`: `render()` gives a picture. `"human"`: a page in the browser shows the drive, in real time; it needs the extra `live`. `None`: nothing is shown. |
    | `view` | `'chase'` | What `render()` shows: `"chase"`, `"top"`, or `"onboard"`, the image of the car's camera with its lens, mounting error and faults. |
    | `width` | `640` | Width of the picture, px. |
    | `height` | `480` | Height of the picture, px. |
    | `scenario` | `'office'` | Family of the generated courses: one of `tral_env.course.generate.SCENARIOS`, which `tral courses` lists. Several in a tuple: every episode draws one of them. |
    | `course` | `None` | Every episode drives this `Course` instead of generated ones. Also its name, one of those that `tral courses` lists, the path of its JSON file, or a mapping of what that file would hold. |
    | `courses` | `None` | Every episode draws one of so many courses, 1 or more. Each is built when it is first driven and then kept (up to 40 kB); course k is the one that `reset(seed=k)` gives without this option. `None`: every episode builds a new course, which takes most of a reset. |
    | `anywhere` | `0.0` | Share of the episodes on generated courses that begin anywhere on the route instead of at its start, 0 to 1: a learner that crashes early sees more of the courses. |
    | `camera` | `'projected'` | `"projected"`: the corners of the markers are projected through the lens, without OpenGL. `"rendered"`: OpenCV's detector searches a rendered image. |
    | `randomization` | `'default'` | How much cars differ from one another: `"none"`, `"default"`, `"hard"`, the path of a file of ranges (.json, .yaml, .yml), or a `Randomization` of other ranges. Several in a tuple: every episode draws one of them. |
    | `groups` | `()` | Optional groups of readings behind the core ones: names out of `"line"`, `"imu"`, `"battery"`. |
    | `car` | `None` | A `CarConfig`: the car's geometry. Only `full_lock_deg` may differ from the car of `assets/car.xml`. |
    | `lens` | `None` | The camera's lens: a `CameraConfig`, `"default"`, `"wide"`, or the path of a calibration file (.yaml, .yml, .xml, .ini). |
    | `task` | `None` | A `TaskConfig`: the weights of the reward, the time limit and the speed of a crash. |
    | `image_faults` | `None` | An `ImageCorruption`: how much of each fault an `image_degradation` of 1 brings to a rendered image. Streaks and covered patches are off by default. |
    | `decision_hz` | `80.0` | Decisions a second: each takes a whole number of ticks of 1/80 s, in which the command is held and rewards add up. A step of the environment is a decision. |
    | `observation` | `'readings'` | `"readings"`: what the car measures, in SI units. `"features"`: the same, made ready for a network, see `tral_env.learner.LearnerView`. |
    | `history` | `1` | Number of frames in an observation, the oldest first. At a reset all of them are the first one. |
    | `spacing_s` | `None` | Time between two frames, a whole number of ticks, s. `None`: that between two decisions. |
    | `growth` | `1.0` | Each distance between two frames is so many times the next one nearer to now, 1 to 2: a few frames reach far back. `1.0`: all are equal. |
    | `action` | `'throttle'` | What the second action is: `"throttle"`, or `"speed"`, which is regulated on the hall sensor as the machines' speed is. |
    | `drive_range` | `None` | What -1 and 1 of the second action stand for: throttles, or speeds in m/s. `None`: -1 and 1, or 0 and 1.2 m/s. A speed below -0.25 m/s is a throttle in reverse, one above it and below 0 is 0. |
    | `detections` | `True` | Whether features tell gates and turn signs. A network is smaller without them. |
    | `memory` | `False` | Whether these come from a memory that reckons with the way of the car: gate, turn sign and the post of each side, where each is now, for 10 s and once in an observation. `False`: each frame tells gate and sign where they were when seen. |

    `None` for `car`, `lens`, `task` and `image_faults` is the configuration's own default. These and `randomization`
    also take a mapping of values, so `spec.to_json()` works with all of them. "hard" also makes the courses harder, see
    `hard_courses` of `Randomization`; a level of your own on the base "hard" keeps that.

    ## Reset Options
    `reset(seed=k, options={...})` takes:

    | option | what it is |
    | --- | --- |
    | `course` | a `tral_env.course.layout.Course`, or its name, the path of its file or a mapping, for this episode; car and noise stay those of the seed |
    | `car` | values of `Randomization` parameters that are not to be drawn, such as `{"friction": 0.6}` |
    | `reset_mask` | (n,) bool, in a vector environment with `autoreset_mode="Disabled"` alone: the rows to reset |

    ## Version History
    * v0: the first version.
    """  # noqa: E501

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": int(CONTROL_RATE_HZ)}  # noqa: RUF012 (Gymnasium declares it so)

    _image_size: tuple[int, int] | None = None
    """Width and height of the image in the observation, px."""

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
        check_pictures(render_mode, view, width, height, self.metadata["render_modes"])
        self.render_mode, self._view, self._size = render_mode, view, (width, height)
        config = CorridorConfig.of(
            options, allowed=inspect.signature(type(self)).parameters, image_size=self._image_size
        )
        self.metadata = {**type(self).metadata, "render_fps": round(config.decision_hz)}
        self.world = World(1, config)
        self._decisions = Decisions(self.world)
        self._human = open_human_view() if render_mode == "human" else None
        self.action_space = action_space()
        self.observation_space: spaces.Space[Any] = self._decisions.space()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start a new episode.

        Args:
            seed: draws course, car and noise; None: the generator of the episodes before goes on.
            options: see Reset Options of the class.

        Returns:
            The first observation, and the info of a reset.

        Raises:
            ConfigError: the seed or an option is unknown or not allowed.
            CourseError: the course cannot be built, or its file is no course.
        """
        if not is_seed(seed):
            raise ConfigError(f"seed = {seed!r}: expected a whole number, 0 or more, or None")
        request = self.world.request(_ROW, options)
        super().reset(seed=None if seed is None else int(seed))
        car = self._decisions.reset(request, [self.np_random])
        info = self._info(self.world.info())
        info["car"] = {name: float(values[0]) for name, values in car.items()}
        if self._human is not None:
            self._human.show(self.world)
        return self._observation(self._decisions.observation()[0]), info

    def step(self, action: NDArray[np.floating]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for a decision, which is 12.5 ms by default.

        Args:
            action: (2,) steering, throttle.

        Raises:
            ConfigError: the action is not two finite numbers, or there was no reset.
            SimulationError: the physics became unstable; the next reset mends it.
        """
        step = self._decisions.step_alone(as_command(action)[None])
        info = self._info(step.info)
        info["reward_terms"] = {name: number(values) for name, values in step.reward_terms.items()}
        terminated, truncated = number(step.terminated), number(step.truncated)
        if terminated or truncated:
            info["is_success"] = info["success"]
        if self._human is not None:
            self._human.show(self.world)
        return self._observation(step.observation[0]), number(step.reward), terminated, truncated, info

    def _observation(self, readings: NDArray[np.float32]) -> Any:
        return readings

    def _info(self, info: dict[str, Any]) -> dict[str, Any]:
        """Info of the only car as Python numbers and bools, and arrays that nobody else holds."""
        single = dict(info)
        if single["pose"].ndim > 1:
            single = {name: number(values) for name, values in info.items()}
            single["pose"] = info["pose"][0].copy()
        # Not NaN, which is unequal to itself: Gymnasium's checker would call the env not deterministic.
        for name in ("clearance_left_m", "clearance_right_m"):
            if math.isnan(single[name]):
                del single[name]
        return single

    @property
    def provided_readings(self) -> frozenset[str]:
        """Names of the fields that the car measures: all of the observation."""
        return frozenset(self.world.layout.names)

    @property
    def learner_options(self) -> dict[str, object]:
        """Options, name -> value, with which a step is no plain tick, for `tral_env.interface.check_readings`."""
        return self.world.config.learner_options

    @property
    def plan(self) -> Plan:
        """Geometry of the course that is driven.

        Raises:
            ConfigError: there was no reset.
        """
        plan = self.world.plans[0]
        if plan is None:
            raise ConfigError("there is no course before the first reset()")
        return plan

    @property
    def course(self) -> Course:
        """The course that is driven.

        Raises:
            ConfigError: there was no reset.
        """
        course = self.world.courses[0]
        if course is None:
            raise ConfigError("there is no course before the first reset()")
        return course

    def render(self) -> NDArray[np.uint8] | None:
        """The chosen view, (height, width, 3) uint8; None without a render mode, and where a page shows the drive."""
        return self.render_view(self._view, *self._size) if self.render_mode == "rgb_array" else None

    def render_view(self, view: str, width: int = 640, height: int = 480) -> NDArray[np.uint8]:
        """Render any view at any time.

        Args:
            view: "chase", "top", or "onboard": the last image of the car's camera, with black beside it if its
                proportions are others; with the projected camera, which takes none, the one that it would take now.
            width: of the picture, px.
            height: of the picture, px.

        Returns:
            (height, width, 3) uint8.

        Raises:
            ConfigError: an unknown view, a size that is none, or there was no reset.
            RenderError: no OpenGL on this machine.
        """
        return self.world.render(view, 0, width, height)

    def stills(self) -> Stills:
        """Take pictures that are rendered later, beside the drive; see `render_view`."""
        return self.world.stills(0)

    def close(self) -> None:
        """Free what OpenGL holds, and close the page."""
        self.world.close()
        if self._human is not None:
            self._human.close()


if TralCorridorEnv.__doc__:  # absent under python -OO
    TralCorridorEnv.__doc__ = TralCorridorEnv.__doc__.replace("{fields}", CORE_LAYOUT.table().replace("\n", "\n    "))


@takes(inspect.signature(TralCorridorEnv).parameters.values())
class TralCorridorPixelsEnv(TralCorridorEnv):
    """`TralCorridor-v0` with the camera's image in the observation.

    ## Observation Space
    `Dict(image=Box(0, 255, (height, width, 3), uint8), readings=Box((d,), float32))`. `image` is the last one that
    has arrived: the camera exposes 15 in a second, through the lens and with the mounting error and degradation that
    were drawn for the car, and each arrives after the camera's latency, together with what the readings tell of it.
    Before the first one arrives `image` is black. `readings` is the observation of `TralCorridor-v0`. The environment
    needs OpenGL.

    ## Arguments
    `image_size`, width and height in pixels, (160, 120) by default, and the arguments of `TralCorridor-v0`. The image
    shows `image_faults` with either camera; the readings of the projected camera do not know of them.

    ## Version History
    * v0: the first version. Before its release an image was observed when it was exposed, without the latency.
    """

    def __init__(self, *, image_size: Sequence[int] = (160, 120), **options: Any) -> None:
        if np.shape(image_size) != (2,) or not all(map(is_count, image_size)):
            raise ConfigError(f"image_size = {image_size!r}: expected width and height, px, such as (160, 120)")
        width, height = (int(length) for length in image_size)
        self._image_size = width, height
        super().__init__(**options)
        EzPickle.__init__(self, image_size=image_size, **options)
        image = spaces.Box(0, 255, (height, width, 3), np.uint8)
        self.observation_space = spaces.Dict({"image": image, "readings": self.world.layout.space()})

    def _observation(self, readings: NDArray[np.float32]) -> Any:
        return {"image": self.world.images()[0], "readings": readings}
