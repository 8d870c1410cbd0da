"""Many drives in one batch: each row has its own machine, and begins the next drive as soon as one ends.

A drive equals that of `rollout.drive` with the same scenario and seed bit for bit, whatever the other rows do.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Self

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from tral_env.course.generate import generate_plan
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course
from tral_env.course.scene import Pool
from tral_env.options import CorridorConfig
from tral_env.randomization import level
from tral_env.world import Drawn, Step, World, car_stream
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.episode import EpisodeRequest, EpisodeResult
from tral_fsm.evaluation.loop import DriveLoop, Index, Observer, row_info
from tral_fsm.evaluation.row_policies import DriverPool, RowPolicies, Spectator
from tral_fsm.evaluation.stuck import StuckWatch

Array = NDArray[np.float64]

MAX_ROWS = 128
"""Largest number of drives at once. Source: measured; more rows save little, and the last drives end later."""


class BatchRunner:
    """Rows of cars; each drives any machine on any course, one drive after the other."""

    def __init__(
        self,
        scenarios: Sequence[str],
        *,
        randomization: str = "default",
        camera: str = "projected",
        rows: int = MAX_ROWS,
        nthread: int = 1,
        stuck_s: float | None = None,
        course: Course | None = None,
    ) -> None:
        """Prepare drives; the simulation is built at the first one, with no more rows than there are drives.

        Args:
            scenarios: families of the courses; with `course` only names in the results.
            randomization: how much cars and sensors differ: "none", "default" or "hard".
            camera: "projected" or "rendered".
            rows: largest number of drives at once.
            nthread: number of threads that step the cars.
            stuck_s: a car that is stuck for so long (`stuck.StuckWatch`) ends in a timeout, s; None: no car is.
            course: course that all drives have instead of those of a family.

        Raises:
            ConfigError: a scenario, the camera or the randomization is unknown.
            CourseError: the course cannot be built.
        """
        self._config = CorridorConfig(randomization=randomization, camera=camera, course=course)
        self._pool, self._nthread, self._max_rows = Pool(0), nthread, rows
        self._fixed = None if course is None else (course, build_plan(course))
        if course is None:
            self._config = replace(self._config, scenario=scenarios[0])
            for name in scenarios:
                self._pool = self._pool.union(Pool.for_scenario(name))
        self._world: World | None = None
        self._randomization = level(randomization)
        self.patience_s = math.inf if stuck_s is None else stuck_s
        """Time without progress after which the drive of a car ends, s."""
        self._drawn: dict[tuple[str, int], tuple[Drawn, np.random.Generator]] = {}
        self._rngs: list[np.random.Generator] = []
        self._started = False

    def prepare(self, drives: int) -> World:
        """Build the simulation for a number of drives, if that at hand has fewer rows than they can use."""
        rows = min(self._max_rows, drives)
        if self._world is None or self._world.n < rows:
            self.close()
            self._world = World(rows, self._config, nthread=self._nthread, pool=self._pool)
            self._rngs, self._started = [np.random.default_rng(0)] * rows, False
        return self._world

    def drive(
        self,
        machines: Sequence[MachineDefinition],
        requests: Sequence[EpisodeRequest],
        on_tick: Callable[[int], None] | None = None,
        observers: Mapping[int, Sequence[Observer]] | None = None,
    ) -> list[EpisodeResult]:
        """Drive all requests.

        Args:
            machines: machines to which the requests refer.
            requests: the drives, in the order in which they begin.
            on_tick: called each tick with the number of drives that have ended; it may raise to break off.
            observers: number of a request -> functions that are called with each tick of its drive.

        Returns:
            The results, in the order of the requests.

        Raises:
            FormatError: a machine cannot run.
            SimulationError: the physics of a car became unstable.
        """
        return self.drive_with(lambda world: DriverPool(machines, world.n), requests, on_tick, observers)

    def drive_with(
        self,
        make: Callable[[World], RowPolicies],
        requests: Sequence[EpisodeRequest],
        on_tick: Callable[[int], None] | None = None,
        observers: Mapping[int, Sequence[Observer]] | None = None,
        spectator: Spectator | None = None,
    ) -> list[EpisodeResult]:
        """Drive all requests with policies of any kind.

        Args:
            make: makes the policies of the rows, for the cars that they will drive.
            requests: the drives, in the order in which they begin.
            on_tick: called each tick with the number of drives that have ended; it may raise to break off.
            observers: number of a request -> functions that are called with each tick of its drive.
            spectator: is shown every tick and every result as it comes.

        Returns:
            The results, in the order of the requests.

        Raises:
            TralError: a policy fails.
            SimulationError: the physics of a car became unstable.
        """
        if not requests:
            return []
        world = self.prepare(len(requests))
        run = _Run(self, world, make(world), requests, observers or {}, spectator)
        run.fill(np.arange(min(world.n, len(requests))))
        while run.loop.active.size:
            run.tick()
            if on_tick is not None:
                on_tick(run.ended)
        return complete(run.results)

    def draw(self, request: EpisodeRequest) -> tuple[Drawn, np.random.Generator]:
        """Course and car of a drive, and the generator of its noise; drawn once, as many machines drive the same."""
        key = request.scenario, request.seed
        if key not in self._drawn:
            rng = seeding.np_random(request.seed)[0]
            course, plan = self._fixed or generate_plan(request.scenario, rng, hard=self._randomization.hard_courses)
            own = car_stream(rng)
            self._drawn[key] = Drawn(course, plan, self._randomization.draw(own)), own
        drawn, rng = self._drawn[key]
        return drawn, copy.deepcopy(rng)

    def begin(self, world: World, rows: Index, requests: Sequence[EpisodeRequest]) -> None:
        """Put the cars of the rows at the start of their drives."""
        fresh = [self.draw(request) for request in requests]
        for row, (_, rng) in zip(rows, fresh, strict=True):
            self._rngs[row] = rng
        drawn = [each for each, _ in fresh]
        if not self._started:  # all rows need a course once; a row without a drive does not move
            spare = world.n - len(rows)
            rows, drawn = np.append(rows, np.arange(world.n - spare, world.n)), drawn + drawn[:1] * spare
            self._started = True
        world.begin(rows, drawn, self._rngs)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the OpenGL context, if there is one."""
        if self._world is not None:
            self._world.close()
            self._world = None


def complete(results: Sequence[EpisodeResult | None]) -> list[EpisodeResult]:
    """The results, if there is one for each request.

    Raises:
        AssertionError: a request has no result; leaving it out would shift all behind it.
    """
    missing = [number for number, result in enumerate(results) if result is None]
    assert not missing, f"requests without a result: {missing}"
    return [result for result in results if result is not None]


class _Run:
    """The state of one call of `BatchRunner.drive`."""

    def __init__(
        self,
        runner: BatchRunner,
        world: World,
        policies: RowPolicies,
        requests: Sequence[EpisodeRequest],
        observers: Mapping[int, Sequence[Observer]],
        spectator: Spectator | None,
    ) -> None:
        self.runner, self.world, self.requests, self.observers = runner, world, requests, observers
        self.policies, self.spectator = policies, spectator
        n = world.n
        self.results: list[EpisodeResult | None] = [None] * len(requests)
        self.loop = DriveLoop(n, world, policies)
        self.ended = 0
        self._next = 0
        self._number = np.full(n, -1)
        """Number of the request that each row drives."""
        self._stuck = StuckWatch(n, runner.patience_s)

    def fill(self, free: Index) -> None:
        """Give the next requests to free rows."""
        rows = free[: len(self.requests) - self._next]
        if not rows.size:
            return
        numbers = range(self._next, self._next + len(rows))
        self._next += len(rows)
        self.runner.begin(self.world, rows, [self.requests[k] for k in numbers])
        watched = {}
        for row, k in zip(rows.tolist(), numbers, strict=True):
            self._number[row] = k
            self.policies.assign(row, self.requests[k])
            if k in self.observers:
                watched[row] = self.observers[k]
        self._stuck.reset(rows)
        self.loop.begin(rows, watched)

    def tick(self) -> None:
        """Drive all rows for one tick; where a drive ends, the next begins."""
        rows = self.loop.active
        step = self.loop.tick()
        if self.spectator is not None:
            self.spectator.watch(rows, self._number[rows], self.world, step)
        gained_m = step.info["progress"] * self.world.track.length
        over = step.terminated | step.truncated | self._stuck.stuck(gained_m, step.info["time_s"])
        done = rows[over[rows]]
        if done.size:
            for row in done.tolist():
                self._finish(row, step)
            self.fill(done)

    def _finish(self, row: int, step: Step) -> None:
        """Keep the result of the drive of a row."""
        number = int(self._number[row])
        request = self.requests[number]
        result = self.results[number] = EpisodeResult(
            scenario=request.scenario,
            seed=request.seed,
            route_m=float(self.world.track.length[row]),
            **self.loop.metrics.figures(row, row_info(step, row)),
        )
        self.loop.end(row)
        self.policies.release(row)
        self.ended += 1
        if self.spectator is not None:
            self.spectator.finish(number, result)
