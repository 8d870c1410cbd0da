"""Machines on courses, in as many processes as are wanted, and a race in which the weak drop out early."""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import asdict, dataclass
from types import TracebackType
from typing import Any, Self

from tral_env.course.generate import SCENARIOS
from tral_env.errors import ConfigError, nearest
from tral_env.randomization import LEVELS
from tral_fsm.definition import MachineDefinition
from tral_fsm.fleet import ROWS, Drive, Fleet, Job
from tral_fsm.tuning.objective import Objective

Course = tuple[str, int]
"""Scenario and seed."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """On what machines are tried."""

    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    """Each scenario is driven with each of them; the same for every machine, so that luck does not decide."""
    randomization: str = "default"
    camera: str = "projected"
    stuck_s: float | None = 10.0
    """Who gains less than 0.25 m in this time is given up, s; None: the time limit of the course holds."""

    def __post_init__(self) -> None:
        for name in self.scenarios:
            if name not in SCENARIOS:
                raise ConfigError(f"unknown scenario '{name}': {nearest(name, SCENARIOS)}")
        if self.randomization not in LEVELS:
            raise ConfigError(f"unknown randomization '{self.randomization}': {nearest(self.randomization, LEVELS)}")
        if not self.scenarios or not self.seeds:
            raise ConfigError("expected at least one scenario and one seed")

    @property
    def courses(self) -> list[Course]:
        """Every course, the scenarios in turn, so that a few of them have something of each."""
        return [(scenario, seed) for seed in self.seeds for scenario in self.scenarios]

    def record(self) -> dict[str, Any]:
        """As plain values."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}


@dataclass(frozen=True, kw_only=True)
class Racing:
    """All candidates drive a few courses; the better ones drive the rest."""

    share: float = 0.25
    """Of the courses, in the first round."""
    keep: float = 0.5
    """Of the candidates, after it; 1: no race."""

    def rounds(self, courses: Sequence[Course], scenarios: int) -> list[Sequence[Course]]:
        """The courses of each round."""
        first = max(math.ceil(self.share * len(courses)), min(scenarios, len(courses)))
        if self.keep >= 1.0 or first >= len(courses):
            return [courses]
        return [courses[:first], courses[first:]]


@dataclass(frozen=True)
class Scored:
    """A machine's drives and what they cost together."""

    drives: tuple[Drive, ...]
    cost: float
    """Of who dropped out of a race: at least that of the weakest that did not."""
    full: bool
    """It has driven all courses."""


class Evaluator:
    """Drives machines on courses; a context manager. The results do not depend on `processes` or `rows`."""

    def __init__(self, task: Task, *, processes: int = 1, rows: int = ROWS) -> None:
        """Nothing is built before the first drive.

        Args:
            task: families, randomization and camera; the seeds are named by each call.
            processes: how many work.
            rows: drives at once in each.
        """
        self.task, self.processes, self.rows = task, processes, rows
        self._fleet: Fleet | None = None
        self._pool: ProcessPoolExecutor | None = None
        self._stop: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the processes; what they drive is given up."""
        if self._pool is not None:
            self._stop.set()
            self._pool.shutdown(cancel_futures=True)
            self._pool = None
        if self._fleet is not None:
            self._fleet.close()
            self._fleet = None

    def drive(self, machines: Sequence[MachineDefinition], jobs: Sequence[Job]) -> list[Drive]:
        """Drive all jobs; how each went, in their order."""
        if self.processes == 1 or len(jobs) == 1:
            if self._fleet is None:
                self._fleet = _fleet(self.task, self.rows)
            return self._fleet.drive(machines, jobs)
        if self._pool is None:
            self._start()
        assert self._pool is not None
        parts = [list(jobs[k :: self.processes]) for k in range(self.processes)]
        futures: list[Future[list[Drive]]] = [self._pool.submit(_drive, list(machines), part) for part in parts]
        drives: list[Drive | None] = [None] * len(jobs)
        for k, future in enumerate(futures):
            drives[k :: self.processes] = future.result()
        return [drive for drive in drives if drive is not None]

    def _start(self) -> None:
        # Threads do not survive a fork.
        context = multiprocessing.get_context("spawn")
        self._stop = context.Event()
        self._pool = ProcessPoolExecutor(self.processes, context, _begin, (self.task, self.rows, self._stop))

    def on_courses(self, machines: Sequence[MachineDefinition], courses: Iterable[Course]) -> list[list[Drive]]:
        """Every machine on every course; per machine its drives in the order of the courses."""
        courses = list(courses)
        # Courses outside, so that no machine's drives all come last.
        jobs = [Job(k, *course) for course in courses for k in range(len(machines))]
        drives = self.drive(machines, jobs)
        return [drives[k :: len(machines)] for k in range(len(machines))]

    def race(
        self,
        machines: Sequence[MachineDefinition],
        courses: Sequence[Course],
        objective: Objective,
        racing: Racing,
    ) -> list[Scored]:
        """Score machines; who is among the weaker ones after the first round drives no more.

        Args:
            machines: the candidates.
            courses: all rounds together.
            objective: what is low for a good machine.
            racing: how the rounds are laid out.
        """
        first, *more = racing.rounds(courses, len(self.task.scenarios))
        drives = self.on_courses(machines, first)
        costs = [objective.cost(mine) for mine in drives]
        alive = list(range(len(machines)))
        for courses_ in more:
            count = max(math.ceil(racing.keep * len(alive)), 1)
            alive = sorted(sorted(alive, key=lambda k: costs[k])[:count])
            for k, extra in zip(alive, self.on_courses([machines[k] for k in alive], courses_), strict=True):
                drives[k] = drives[k] + extra
                costs[k] = objective.cost(drives[k])
        weakest = max(costs[k] for k in alive)
        return [
            Scored(tuple(mine), cost if k in alive else max(cost, weakest), k in alive)
            for k, (mine, cost) in enumerate(zip(drives, costs, strict=True))
        ]


def _fleet(task: Task, rows: int) -> Fleet:
    return Fleet(task.scenarios, randomization=task.randomization, camera=task.camera, rows=rows, stuck_s=task.stuck_s)


class StoppedError(Exception):
    """A worker was told to give up its drives."""


class _Worker:
    """What a process of its own keeps from call to call."""

    fleet: Fleet
    check: Callable[[int], None]


def _begin(task: Task, rows: int, stop: Any) -> None:
    """Prepare a process. Ctrl-C is for the one that started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ticks = 0

    def check(_: int) -> None:
        nonlocal ticks
        ticks += 1
        if ticks % 32 == 0 and stop.is_set():
            raise StoppedError

    _Worker.fleet, _Worker.check = _fleet(task, rows), staticmethod(check)


def _drive(machines: list[MachineDefinition], jobs: list[Job]) -> list[Drive]:
    return _Worker.fleet.drive(machines, jobs, _Worker.check)
