"""Cars on their courses: simulation and task together, n at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tral_env import task
from tral_env.course.generate import generate_plan
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course
from tral_env.course.plan import Plan
from tral_env.course.scene import Pool
from tral_env.errors import ConfigError, nearest
from tral_env.interface import Layout
from tral_env.options import CorridorConfig, as_course, check_counts
from tral_env.randomization import Randomization, level, makes_hard_courses
from tral_env.simulation.culling import LOCAL_BOXES, max_boxes_in_reach
from tral_env.simulation.sim import Simulation
from tral_env.simulation.views import VIEWS, Views, fitted
from tral_env.simulation.vision import Webcam

__all__ = [
    "VIEWS",
    "CorridorConfig",
    "Drawn",
    "Simulation",
    "Step",
    "Views",
    "Webcam",
    "World",
    "check_pictures",
    "fitted",
]
"""The environments see the simulation through this module alone."""

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]

RESET_OPTIONS = ("course", "car")
"""What ``reset(options=...)`` understands."""


def _checked(options: Mapping[str, Any]) -> Mapping[str, Any]:
    """The options of a reset, which may be those of `RESET_OPTIONS`."""
    if not isinstance(options, Mapping):
        raise ConfigError(f"options = {options!r}: expected a mapping with {', '.join(RESET_OPTIONS)}")
    for name in options:
        if name not in RESET_OPTIONS:
            raise ConfigError(f"unknown reset option '{name}': {nearest(name, RESET_OPTIONS)}")
    return options


def check_pictures(render_mode: str | None, view: str, width: object, height: object) -> None:
    """Refuse what no picture can be rendered with.

    Raises:
        ConfigError: an unknown render mode or view, or a size that is none.
    """
    if render_mode not in (None, "rgb_array"):
        raise ConfigError(f"unknown render_mode {render_mode!r}. Allowed: None, 'rgb_array'")
    if view not in VIEWS:
        raise ConfigError(f"unknown view '{view}': {nearest(view, VIEWS)}")
    check_counts(width=width, height=height)


class Drawn(NamedTuple):
    """What is drawn for an episode."""

    course: Course
    plan: Plan
    car: dict[str, float]
    """Parameters of the car, name -> value; see `Randomization`."""


@dataclass(frozen=True)
class Step:
    """What n cars got in a tick, as arrays of (n, ...)."""

    observation: NDArray[np.float32]
    reward: Array
    terminated: Flags
    truncated: Flags
    info: dict[str, Array | Flags | Index]
    """Ground truth, name -> (n, ...)."""
    reward_terms: dict[str, Array]
    """What the reward is the sum of, name -> (n,)."""


def car_stream(rng: np.random.Generator) -> np.random.Generator:
    """Give the generator of an episode's car and noise, which do not depend on whether its course is drawn or given.

    Args:
        rng: generator of the episode; the course is drawn from it. Each call gives another stream.
    """
    return rng.spawn(1)[0]


class World:
    """n cars on n courses."""

    def __init__(self, n: int, config: CorridorConfig, *, nthread: int = 1, pool: Pool | None = None) -> None:
        """Build the simulation; `reset` must come first.

        Args:
            n: number of cars.
            config: what they drive.
            nthread: threads that step them.
            pool: room for courses of more than one family; None: for those of `config`.
        """
        self.n, self.config, self._nthread = n, config, nthread
        self.layout = Layout.of(config.groups)
        self._randomization = level(config.randomization)
        self._hard = makes_hard_courses(config.randomization)
        fixed = config.fixed_course()
        self._fixed = None if fixed is None else (fixed, build_plan(fixed))
        self._near = 0 if self._fixed is None else max_boxes_in_reach(self._fixed[1])
        own = Pool.for_scenario(config.scenario) if self._fixed is None else Pool.of(self._fixed[1])
        self.sim = self._simulation(own if pool is None else own.union(pool))
        self.track = task.empty_track(n)
        self._started = False
        self.kept: dict[int, tuple[Course, Plan]] = {}
        """Courses that were built so far, of those that `CorridorConfig.courses` keeps."""
        self.courses: list[Course | None] = [None] * n
        self.plans: list[Plan | None] = [None] * n
        self._everyone = np.arange(n)
        self._length = np.zeros(n)
        self._limit_s = np.zeros(n)
        self._segment = np.zeros(n, np.int64)
        self._s = np.zeros(n)
        self._lateral = np.zeros(n)
        self._passed = np.zeros(n, np.int64)
        self._steering = np.zeros(n)

    def _simulation(self, pool: Pool) -> Simulation:
        config = self.config
        return Simulation(
            self.n,
            pool,
            camera=config.camera,
            layout=self.layout,
            car=config.car,
            lens=config.lens,
            nthread=self._nthread,
            near=self._near,
            image_faults=config.image_faults,
        )

    def reset(
        self, rows: Index, rngs: Sequence[np.random.Generator], options: Mapping[str, Any] | None = None
    ) -> dict[str, Array]:
        """Put the cars of the rows at the start of new courses.

        Args:
            rows: (k,) which cars.
            rngs: generator of each of all n rows; only those of the rows are used.
            options: ``course``: a `Course` or the path of one, for these rows; ``car``: parameters of the car that are
                not to be drawn, name -> value, or name -> (n,) values: what an earlier reset returned drives again.

        Returns:
            The parameters of all cars, name -> (n,).

        Raises:
            ConfigError: unknown option or parameter; the course does not fit beside the other rows; the first reset
                leaves out a car; the course file cannot be opened.
            CourseError: the course cannot be built, or its file is no course.
        """
        if not self._started and len(rows) != self.n:
            raise ConfigError(f"the first reset starts {len(rows)} of {self.n} cars: expected all")
        options = _checked(options or {})
        cars = self._cars(options.get("car"))
        given = as_course(options.get("course"))
        fixed = self._fixed if given is None else (given, build_plan(given))
        if not len(rows):
            return self._parameters()
        streams = list(rngs)
        for row in rows:
            streams[row] = car_stream(rngs[row])
        drawn = [Drawn(*self._course(rngs[row], fixed), cars(int(row)).draw(streams[row])) for row in rows]
        if given is not None:
            self._fit([drawn[0].plan], rows, max_boxes_in_reach(drawn[0].plan))
        self.begin(rows, drawn, streams)
        return self._parameters()

    def begin(self, rows: Index, drawn: Sequence[Drawn], rngs: Sequence[np.random.Generator]) -> None:
        """Put cars at the start of courses that were drawn already; the first time all cars.

        Args:
            rows: (k,) which cars.
            drawn: k courses with their plans and cars.
            rngs: generator of each of all n rows, for the noise; only those of the rows are used.

        Raises:
            ConfigError: a course does not fit beside the other rows.
        """
        plans = [one.plan for one in drawn]
        self._fit(plans, rows)
        for row, one in zip(rows, drawn, strict=True):
            self.courses[row], self.plans[row] = one.course, one.plan
            task.lay(self.track, int(row), one.plan)
        self.sim.reset(rows, plans, [one.car for one in drawn], rngs)
        self._line_up(rows)
        self._started = True

    def _line_up(self, rows: Index) -> None:
        """Put the rows at the beginning of their routes."""
        position, first = self.sim.pose[rows, :2], np.zeros(len(rows), np.int64)
        self._s[rows], self._lateral[rows], self._segment[rows] = task.locate(self.track, rows, position, first)
        self._length = self.track.length.copy()
        self._limit_s = task.time_limit(self._length, self.config.task)
        self._passed[rows] = 0
        self._steering[rows] = 0.0

    def _parameters(self) -> dict[str, Array]:
        return {name: values.copy() for name, values in self.sim.parameters.items()}

    def _cars(self, given: Mapping[str, Any] | None) -> Callable[[int], Randomization]:
        """Randomization of each row, where some parameters are given: for all cars, or one value each."""
        if given is None:
            return lambda row: self._randomization
        wrong = f"options['car'] = {given!r}: expected name -> number or {self.n} numbers"
        if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
            raise ConfigError(wrong)
        # A vector environment tells its parameters with masks, `_name`.
        given = {name: value for name, value in given.items() if not name.startswith("_")}
        try:
            values = {name: np.broadcast_to(np.asarray(value, float), self.n) for name, value in given.items()}
        except (TypeError, ValueError, OverflowError):
            raise ConfigError(wrong) from None
        return lambda row: self._randomization.fixed(**{name: float(value[row]) for name, value in values.items()})

    def _course(self, rng: np.random.Generator, fixed: tuple[Course, Plan] | None) -> tuple[Course, Plan]:
        return self._generate(rng) if fixed is None else fixed

    def _generate(self, rng: np.random.Generator) -> tuple[Course, Plan]:
        """A new course, or one of those that are kept."""
        scenario, hard, count = self.config.scenario, self._hard, self.config.courses
        if count is None:
            return generate_plan(scenario, rng, hard=hard)
        k = int(rng.integers(count))
        if k not in self.kept:
            self.kept[k] = generate_plan(scenario, np.random.default_rng(k), hard=hard)
        return self.kept[k]

    def _fit(self, plans: Sequence[Plan], rows: Index, near: int = 0) -> None:
        """Rebuild the simulation if a plan needs more walls or markers than it has, or more of them near the car."""
        needed = self.sim.pool
        for plan in plans:
            needed = needed.union(Pool.of(plan))
        if needed == self.sim.pool and near <= max(self._near, LOCAL_BOXES):
            return
        if len(rows) != self.n:
            told = f", {near} boxes near the car" if near > LOCAL_BOXES else ""
            raise ConfigError(
                f"this course needs {needed}{told}, but the cars were built for {self.sim.pool}: "
                "give the course to make_vec(course=...), or reset all cars at once"
            )
        self.sim.close()
        self._near = max(self._near, near)
        self.sim = self._simulation(needed)

    def observation(self) -> NDArray[np.float32]:
        """What the policies are told now, (n, d)."""
        return self.sim.observation()

    def step(self, command: NDArray[np.floating], rows: Index | None = None) -> Step:
        """Drive for one tick.

        Args:
            command: (n, 2) steering, throttle.
            rows: (k,) the cars that move; None: all.

        Raises:
            ConfigError: the cars have no courses yet.
            SimulationError: the physics of a car became unstable; it has to be reset.
        """
        if not self._started:
            raise ConfigError("step() before the first reset()")
        sim, config = self.sim, self.config.task
        before = sim.pose[:, :2].copy()
        sim.step(np.asarray(command, np.float64), rows)
        s, self._lateral, self._segment = task.locate(self.track, self._everyone, sim.pose[:, :2], self._segment)
        through, missed = task.cross_gates(self.track, before, sim.pose[:, :2], s, self._passed)
        self._passed = self._passed + through
        arrived = s >= self._length - 1e-6
        missed |= arrived & (self._passed < self.track.gates)
        failure = sim.collision | missed
        success = arrived & ~failure
        outcome = task.Outcome(
            advance=s - self._s,
            gate=through,
            success=success,
            failure=failure,
            steering_change=sim.command[:, 0] - self._steering,
        )
        self._s, self._steering = s, sim.command[:, 0].copy()
        terminated = success | failure
        truncated = (sim.time_s >= self._limit_s) & ~terminated
        info = self.info(success, missed)
        terms = task.reward_terms(outcome, config)
        return Step(sim.observation(), task.reward(terms), terminated, truncated, info, terms)

    def info(self, success: Flags | None = None, missed: Flags | None = None) -> dict[str, Array | Flags | Index]:
        """The ground truth of all cars, which no policy sees."""
        sim = self.sim
        no = np.zeros(self.n, bool)
        left, right = task.wall_clearance(self.track, sim.pose, self.config.car)
        crash = sim.collision & (sim.closing_speed >= self.config.task.touch_speed)
        return {
            "success": no if success is None else success,
            "collision": sim.collision.copy(),
            "crash": crash,
            "missed_gate": no if missed is None else missed,
            "progress": np.minimum(np.maximum(self._s / self._length, 0.0), 1.0),
            "gates_passed": self._passed.copy(),
            "gates_total": self.track.gates.copy(),
            "clearance_left_m": left,
            "clearance_right_m": right,
            "lateral_offset_m": self._lateral.copy(),
            "pose": sim.pose.copy(),
            "speed_mps": sim.speed.copy(),
            "time_s": sim.time_s.copy(),
        }

    def close(self) -> None:
        """Free the OpenGL context, if there is one."""
        self.sim.close()
