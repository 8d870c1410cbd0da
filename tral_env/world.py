"""Cars on their courses: simulation and task together, n at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tral_env import task
from tral_env.arrays import ALL, ALONE, Array, Flags, Index, Values, as_rows, everyone, maximum, minimum, negation, pick
from tral_env.checks import check_number, one_of
from tral_env.course.generate import generate_plan
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course
from tral_env.course.plan import Plan, begun_anywhere
from tral_env.course.scene import Pool
from tral_env.errors import ConfigError, nearest
from tral_env.interface import STEERING, Layout
from tral_env.options import CorridorConfig, as_course, check_counts
from tral_env.randomization import Randomization
from tral_env.simulation.culling import LOCAL_BOXES, max_boxes_in_reach
from tral_env.simulation.sim import Simulation
from tral_env.simulation.views import VIEWS, Still, Stills, Views, still

__all__ = [
    "RESET_OPTIONS", "Drawn", "ResetRequest", "Step", "Stills", "World", "car_stream", "check_pictures", "how_it_ended",
]  # fmt: skip

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


@dataclass(frozen=True, eq=False)
class ResetRequest:
    """A reset that `World.request` has checked."""

    rows: Index
    """(k,) which cars."""
    cars: Sequence[tuple[Randomization, ...]]
    """Levels of which one is drawn for each of them, and a car out of that, k."""
    course: tuple[Course, Plan] | None
    """The course that they drive; None: each a generated one."""
    near: int = 0
    """Boxes of that course that may be near a car."""


def check_pictures(
    render_mode: str | None, view: str, width: object, height: object, modes: Sequence[str] = ("rgb_array",)
) -> None:
    """Refuse what no picture can be rendered with; `modes` are the render modes that there are beside None.

    Raises:
        ConfigError: an unknown render mode or view, or a size that is none.
    """
    if render_mode is not None and render_mode not in modes:
        raise ConfigError(f"unknown render_mode {render_mode!r}. Allowed: None, {', '.join(map(repr, modes))}")
    one_of("view", view, VIEWS)
    check_counts(width=width, height=height)


class Drawn(NamedTuple):
    """What is drawn for an episode."""

    course: Course
    plan: Plan
    car: dict[str, float]
    """Parameters of the car, name -> value; see `Randomization`."""


@dataclass(eq=False)
class Step:
    """What n cars got in a tick, as arrays of (n, ...); `World.tick` has numbers for a car alone."""

    observation: NDArray[np.float32]
    reward: Values
    terminated: Values
    truncated: Values
    info: dict[str, Values]
    """Ground truth, name -> (n, ...)."""
    reward_terms: dict[str, Values]
    """What the reward is the sum of, name -> (n,)."""

    def as_rows(self) -> Step:
        """The same with arrays, also for a car alone."""
        if isinstance(self.terminated, np.ndarray):
            return self
        told = dict(self.info)
        told["pose"] = told["pose"][None]
        return Step(
            self.observation,
            as_rows(self.reward),
            as_rows(self.terminated),
            as_rows(self.truncated),
            {name: as_rows(value) for name, value in told.items()},
            {name: as_rows(value) for name, value in self.reward_terms.items()},
        )


def _one_of(levels: Sequence[Randomization], rng: np.random.Generator) -> Randomization:
    """One of some levels; nothing is drawn where there is only one."""
    return levels[0] if len(levels) == 1 else levels[int(rng.integers(len(levels)))]


def car_stream(rng: np.random.Generator) -> np.random.Generator:
    """Give the generator of an episode's car and noise, which do not depend on whether its course is drawn or given.

    Args:
        rng: generator of the episode; the course is drawn from it. Each call gives another stream.
    """
    return rng.spawn(1)[0]


def how_it_ended(info: Mapping[str, Any], row: int = 0) -> str:
    """How an episode that is over has ended: "success", "collision", "missed gate" or "time is up".

    Args:
        info: that of the last step, each value a scalar or with a row for each car.
        row: the car.
    """
    for name, ended in (("success", "success"), ("collision", "collision"), ("missed_gate", "missed gate")):
        if np.ravel(info[name])[row]:
            return ended
    return "time is up"


class World:
    """n cars on n courses."""

    views = tuple(VIEWS)
    """Names of the pictures that `render` gives."""

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
        self._levels = config.levels
        fixed = config.fixed_course()
        self._fixed = None if fixed is None else (fixed, build_plan(fixed))
        self._near = 0 if self._fixed is None else max_boxes_in_reach(self._fixed[1])
        families = reduce(Pool.union, map(Pool.for_scenario, config.scenarios))
        own = families if self._fixed is None else Pool.of(self._fixed[1])
        self.sim = self._simulation(own if pool is None else own.union(pool))
        self.track = task.empty_track(n)
        self._started = False
        self._views = Views()
        self.kept: dict[tuple[int, bool], tuple[Course, Plan]] = {}
        """Courses that were built so far, of those that `CorridorConfig.courses` keeps, by number and by whether the
        level makes courses harder."""
        self.courses: list[Course | None] = [None] * n
        self.plans: list[Plan | None] = [None] * n
        self._everyone = everyone(n)
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
            image_size=config.image_size,
        )

    def request(self, rows: Index, options: Mapping[str, Any] | None = None) -> ResetRequest:
        """Check what a reset asks for, before anything is drawn: a reset that is refused changes nothing.

        Args:
            rows: (k,) which cars.
            options: ``course``: a `Course`, its name, path or mapping, for these rows; ``car``: parameters of the car
                that are not to be drawn, name -> value, or name -> (n,) values: what an earlier reset returned drives
                again.

        Raises:
            ConfigError: unknown option or parameter; the course does not fit beside the other rows; the first reset
                leaves out a car; the course file cannot be opened.
            CourseError: the course cannot be built, or its file is no course.
        """
        if not self._started and len(rows) != self.n:
            raise ConfigError(f"the first reset starts {len(rows)} of {self.n} cars: expected all")
        options = _checked({} if options is None else options)
        cars = self._cars(rows, options.get("car"))
        given = as_course(options.get("course"))
        if given is None:
            return ResetRequest(rows, cars, self._fixed)
        plan = build_plan(given)
        near = max_boxes_in_reach(plan)
        if len(rows):
            self._needed([plan], rows, near)
        return ResetRequest(rows, cars, (given, plan), near)

    def reset(self, request: ResetRequest, rngs: Sequence[np.random.Generator]) -> dict[str, Array]:
        """Put cars at the start of new courses.

        Args:
            request: which cars, on what; see `request`.
            rngs: generator of each of all n rows; only those of the request are used.

        Returns:
            The parameters of all cars, name -> (n,).
        """
        rows = request.rows
        if not len(rows):
            return self._parameters()
        streams = list(rngs)
        for row in rows:
            streams[row] = car_stream(rngs[row])
        drawn = []
        for row, levels in zip(rows, request.cars, strict=True):
            level = _one_of(levels, streams[row])
            course = request.course or self._generate(rngs[row], level.hard_courses)
            drawn.append(Drawn(*course, level.draw(streams[row])))
        self.begin(rows, drawn, streams, request.near)
        return self._parameters()

    def begin(self, rows: Index, drawn: Sequence[Drawn], rngs: Sequence[np.random.Generator], near: int = 0) -> None:
        """Put cars at the start of courses that were drawn already; the first time all cars.

        Args:
            rows: (k,) which cars.
            drawn: k courses with their plans and cars.
            rngs: generator of each of all n rows, for the noise; only those of the rows are used.
            near: how many boxes of a course may be near its car, if that may be more than in the families of courses.

        Raises:
            ConfigError: a course does not fit beside the other rows.
        """
        plans = [one.plan for one in drawn]
        self._fit(plans, rows, near)
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
        return {name: values.copy() for name, values in self.sim.car_parameters.drawn.items()}

    def _cars(self, rows: Index, given: Mapping[str, Any] | None) -> list[tuple[Randomization, ...]]:
        """Levels of the rows, where some parameters are given: for all cars, or one value each."""
        if given is None:
            return [self._levels] * len(rows)
        wrong = f"options['car'] = {given!r}: expected name -> number or {self.n} numbers"
        if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
            raise ConfigError(wrong)
        # A vector environment tells each parameter with a mask, `_name`.
        given = {name: value for name, value in given.items() if name[:1] != "_" or name[1:] not in given}
        for name, value in given.items():
            for number in np.asarray(value, object).flat:
                check_number(f"options['car'], {name}", number)
        try:
            values = {name: np.broadcast_to(np.asarray(value, float), self.n) for name, value in given.items()}
        except ValueError:
            raise ConfigError(wrong) from None
        own = [{name: float(value[row]) for name, value in values.items()} for row in rows]
        return [tuple(level.fixed(**each) for level in self._levels) for each in own]

    def _generate(self, rng: np.random.Generator, hard: bool) -> tuple[Course, Plan]:
        """A course to drive, from its start or from anywhere on."""
        (course, plan), anywhere = self._whole(rng, hard), self.config.anywhere
        return course, begun_anywhere(plan, rng) if anywhere and rng.random() < anywhere else plan

    def _whole(self, rng: np.random.Generator, hard: bool) -> tuple[Course, Plan]:
        """A new course, or one of those that are kept."""
        if (count := self.config.courses) is None:
            return self._build(rng, hard)
        key = int(rng.integers(count)), hard
        if key not in self.kept:
            self.kept[key] = self._build(np.random.default_rng(key[0]), hard)
        return self.kept[key]

    def _build(self, rng: np.random.Generator, hard: bool) -> tuple[Course, Plan]:
        """A new course of the family, or of one of several."""
        names = self.config.scenarios
        scenario = names[0] if len(names) == 1 else names[int(rng.integers(len(names)))]
        return generate_plan(scenario, rng, hard=hard)

    def _needed(self, plans: Sequence[Plan], rows: Index, near: int) -> Pool | None:
        """The pool of the simulation that the rows need for their plans; None: the one at hand will do.

        Raises:
            ConfigError: they need another one, and other rows drive in the one at hand.
        """
        needed = self.sim.pool
        for plan in plans:
            needed = needed.union(Pool.of(plan))
        if needed == self.sim.pool and near <= max(self._near, LOCAL_BOXES):
            return None
        if len(rows) != self.n:
            told = f", {near} boxes near the car" if near > LOCAL_BOXES else ""
            raise ConfigError(
                f"this course needs {needed}{told}, but the cars were built for {self.sim.pool}: "
                "give the course to make_vec(course=...), or reset all cars at once"
            )
        return needed

    def _fit(self, plans: Sequence[Plan], rows: Index, near: int) -> None:
        """Rebuild the simulation if a plan needs more walls or markers than it has, or more of them near the car."""
        if (needed := self._needed(plans, rows, near)) is None:
            return
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
        return self.tick(command, rows).as_rows()

    def tick(self, command: NDArray[np.floating], rows: Index | None = None) -> Step:
        """`step`, which gives the numbers of a car alone as such."""
        if not self._started:
            raise ConfigError("step() before the first reset()")
        sim, config, everyone = self.sim, self.config.task, self._everyone
        before = sim.pose[:, :2].copy()
        sim.step(np.asarray(command, np.float64), rows)
        here = sim.pose[:, :2]
        s, lateral, segment = task.locate(self.track, everyone, here, pick(self._segment, everyone))
        passed = pick(self._passed, everyone)
        through, missed = task.cross_gates(self.track, before, here, s, passed, everyone)
        arrived = s >= pick(self._length, everyone) - 1e-6
        missed |= arrived & (passed + through < pick(self.track.gates, everyone))
        failure = pick(sim.truth.collision, everyone) | missed
        success = arrived & negation(failure)
        steering = pick(sim.command[:, STEERING], everyone)
        outcome = task.Outcome(
            advance=s - pick(self._s, everyone),
            gate=through,
            success=success,
            failure=failure,
            steering_change=steering - pick(self._steering, everyone),
        )
        self._passed[everyone] += through
        self._s[everyone], self._steering[everyone] = s, steering
        self._lateral[everyone], self._segment[everyone] = lateral, segment
        terminated = success | failure
        truncated = (pick(sim.time_s, everyone) >= pick(self._limit_s, everyone)) & negation(terminated)
        terms = task.reward_terms(outcome, config)
        info = self._truth(success, missed)
        return Step(sim.observation(), task.reward(terms), terminated, truncated, info, terms)

    def info(self) -> dict[str, Array | Flags | Index]:
        """The ground truth of all cars after a reset, which no policy sees; name -> (n, ...)."""
        told = self._truth(np.zeros(self.n, bool), np.zeros(self.n, bool))
        if self._everyone is ALONE:
            told["pose"] = told["pose"][None]
        return {name: as_rows(values) for name, values in told.items()}

    def _truth(self, success: Flags, missed: Flags) -> dict[str, Any]:
        """The ground truth, in arrays that nobody else holds, or in numbers of a car alone."""
        sim, everyone = self.sim, self._everyone

        def own(values: Any) -> Any:
            return values.copy() if everyone is ALL else values.item(0)

        left, right = task.wall_clearance(self.track, sim.pose, self.config.car, everyone)
        collision, closing = own(sim.truth.collision), pick(sim.truth.closing_speed, everyone)
        return {
            "success": success,
            "collision": collision,
            "crash": collision & (closing >= self.config.task.touch_speed),
            "missed_gate": missed,
            "progress": minimum(maximum(pick(self._s, everyone) / pick(self._length, everyone), 0.0), 1.0),
            "gates_passed": own(self._passed),
            "gates_total": own(self.track.gates),
            "clearance_left_m": left,
            "clearance_right_m": right,
            "lateral_offset_m": own(self._lateral),
            "pose": sim.pose[everyone].copy(),
            "speed_mps": own(sim.truth.speed),
            "time_s": own(sim.time_s),
            "time_limit_s": own(self._limit_s),
        }

    def images(self) -> NDArray[np.uint8]:
        """What the cameras show, (n, height, width, 3): the last images that have arrived, black before the first.

        Raises:
            ConfigError: the configuration has no `image_size`.
        """
        return self.sim.images()

    def render(self, view: str, row: int, width: int, height: int) -> NDArray[np.uint8]:
        """Picture of a car, (height, width, 3); "onboard" is the observed image, if images are observed.

        Args:
            view: one of `views`.
            row: which car.
            width: px.
            height: px.

        Raises:
            ConfigError: an unknown view, a size that is none, or there was no reset.
            RenderError: no OpenGL on this machine.
        """
        check_pictures(None, view, width, height)
        return self._views.render(self.still(view, row), width, height)

    def stills(self, row: int) -> Stills:
        """Pictures of a car that are taken now and rendered later, with an OpenGL context of their own."""
        return Stills(lambda view: self.still(view, row))

    def still(self, view: str, row: int) -> Still:
        """What a view of a car shows now; see `render`."""
        kept = still(self.sim, "chase" if self._observes_images(view) else view, row)
        return replace(kept, view=view, image=self.images()[row]) if self._observes_images(view) else kept

    def _observes_images(self, view: str) -> bool:
        return view == "onboard" and self.config.image_size is not None

    def close(self) -> None:
        """Free what OpenGL holds."""
        self.sim.close()
        self._views.close()
