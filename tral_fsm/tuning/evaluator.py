"""Machines on courses, in as many processes as are wanted, and a race in which the weak drop out early."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, wait
from dataclasses import asdict, dataclass, replace
from types import TracebackType
from typing import Any, Self

from tral_env.errors import ConfigError, nearest
from tral_env.randomization import LEVELS
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.batch import ROWS, BatchRunner
from tral_fsm.evaluation.choices import check_families
from tral_fsm.evaluation.episode import EpisodeRequest, EpisodeResult
from tral_fsm.evaluation.pool import ProcessPool, spawned, stop_check
from tral_fsm.tuning.objective import Objective

Course = tuple[str, int]
"""Scenario and seed."""
_LOOK_S = 0.2
"""So often the drives of other processes are counted."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """On what machines are tried."""

    scenarios: tuple[str, ...]
    seeds: tuple[int, ...]
    """Each scenario is driven with each of them; the same for every machine, so that luck does not decide."""
    randomization: str = "default"
    camera: str = "projected"
    stuck_s: float | None = 10.0
    """A car that gains less than 0.25 m in this time is given up, s; None: the time limit of the course holds."""

    def __post_init__(self) -> None:
        check_families(self.scenarios)
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

    drives: tuple[EpisodeResult, ...]
    cost: float
    """Of a machine that dropped out of a race: at least that of the weakest that did not."""
    full: bool
    """It has driven all courses."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """What is under way, and how far."""

    name: str
    done: int
    total: int
    unit: str = "drives"


OnStage = Callable[[Stage], None]


class Evaluator:
    """Drives machines on courses; a context manager. The results do not depend on `processes` or `rows`."""

    def __init__(self, task: Task, *, processes: int = 1, rows: int = ROWS, on_stage: OnStage | None = None) -> None:
        """Nothing is built before the first drive.

        Args:
            task: families, randomization and camera; the seeds are named by each call.
            processes: how many work.
            rows: drives at once in each.
            on_stage: called when a stage begins, and in it whenever drives have ended.
        """
        self.task, self.processes, self.rows = task, processes, rows
        self._on_stage = on_stage
        self._stage = Stage(name="", done=0, total=0)
        self._runner: BatchRunner | None = None
        self._pool: ProcessPool | None = None
        self._ended: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the processes; what they drive is given up."""
        if self._pool is not None:
            self._pool.close()
            self._pool = None
        if self._runner is not None:
            self._runner.close()
            self._runner = None

    def stage(self, name: str, total: int, done: int = 0) -> None:
        """Name what is driven from now on, for `on_stage`."""
        self._stage = Stage(name=name, done=done, total=total)
        self._count(0)

    def _count(self, ended: int) -> None:
        """So many more drives have ended."""
        self._stage = replace(self._stage, done=self._stage.done + ended)
        if self._on_stage is not None:
            self._on_stage(self._stage)

    def drive(self, machines: Sequence[MachineDefinition], requests: Sequence[EpisodeRequest]) -> list[EpisodeResult]:
        """Drive all requests; how each went, in their order."""
        if self.processes == 1 or len(requests) == 1:
            if self._runner is None:
                self._runner = _runner(self.task, self.rows)
            return self._runner.drive(machines, requests, _changes(self._count))
        if self._pool is None:
            self._start()
        assert self._pool is not None
        parts = [list(requests[k :: self.processes]) for k in range(self.processes)]
        futures: list[Future[list[EpisodeResult]]] = [self._pool.submit(_drive, list(machines), part) for part in parts]
        self._watch(futures)
        drives: list[EpisodeResult | None] = [None] * len(requests)
        for k, future in enumerate(futures):
            drives[k :: self.processes] = future.result()
        return [drive for drive in drives if drive is not None]

    def _start(self) -> None:
        self._ended = spawned.Value("l", 0)
        self._pool = ProcessPool(self.processes, _begin, self.task, self.rows, self._ended)

    def _watch(self, futures: Sequence[Future[list[EpisodeResult]]]) -> None:
        """Count the drives of the processes until all have ended, or one has failed."""
        counted = self._ended.value
        done, left = wait(futures, _LOOK_S, FIRST_EXCEPTION)
        while True:
            ended = self._ended.value
            if ended > counted:
                self._count(ended - counted)
            counted = ended
            if not left or any(each.exception() for each in done):
                return
            done, left = wait(futures, _LOOK_S, FIRST_EXCEPTION)

    def on_courses(self, machines: Sequence[MachineDefinition], courses: Iterable[Course]) -> list[list[EpisodeResult]]:
        """Every machine on every course; per machine its drives in the order of the courses."""
        courses = list(courses)
        # Courses outside, so that no machine's drives all come last.
        requests = [EpisodeRequest(k, *course) for course in courses for k in range(len(machines))]
        drives = self.drive(machines, requests)
        return [drives[k :: len(machines)] for k in range(len(machines))]

    def race(
        self,
        machines: Sequence[MachineDefinition],
        courses: Sequence[Course],
        objective: Objective,
        racing: Racing,
    ) -> list[Scored]:
        """Score machines; those among the weaker ones after the first round drive no more.

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


def _runner(task: Task, rows: int) -> BatchRunner:
    return BatchRunner(
        task.scenarios, randomization=task.randomization, camera=task.camera, rows=rows, stuck_s=task.stuck_s
    )


def _changes(count: Callable[[int], None]) -> Callable[[int], None]:
    """Of a number that is told each tick, pass on by how much it has grown."""
    before = 0

    def changed(now: int) -> None:
        nonlocal before
        if now > before:
            count(now - before)
            before = now

    return changed


class _Worker:
    """What a process of its own keeps from call to call."""

    runner: BatchRunner
    ended: Any


def _begin(task: Task, rows: int, ended: Any) -> None:
    """Prepare a process."""
    _Worker.runner, _Worker.ended = _runner(task, rows), ended


def _drive(machines: list[MachineDefinition], requests: list[EpisodeRequest]) -> list[EpisodeResult]:
    stop, count = stop_check(), _changes(_add)

    def check(ended: int) -> None:
        stop(ended)
        count(ended)

    return _Worker.runner.drive(machines, requests, check)


def _add(ended: int) -> None:
    with _Worker.ended.get_lock():
        _Worker.ended.value += ended
