"""Drives of many machines on many courses, in several processes, and races in which weak candidates drop out early."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, wait
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from types import TracebackType
from typing import Any, Self

from tral_env.checks import check_number, one_of
from tral_env.course.layout import Course
from tral_env.errors import ConfigError, nearest
from tral_env.options import CAMERAS
from tral_env.randomization import LEVELS
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.batch import MAX_ROWS, BatchRunner, complete
from tral_fsm.evaluation.choices import check_families
from tral_fsm.evaluation.cluster import Cluster, Workers
from tral_fsm.evaluation.episode import EpisodeRequest, EpisodeResult
from tral_fsm.evaluation.pool import ProcessPool, spawned, stop_check, worker_losses
from tral_fsm.evaluation.seeds import check_seeds
from tral_fsm.tuning.objective import Objective

SeededCourse = tuple[str, int]
"""Scenario and seed."""
_LOOK_S = 0.2
"""Time between two counts of the drives of other processes, s."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """Courses, cars and sensors of the drives."""

    scenarios: tuple[str, ...]
    """Families of the courses; with `course` a name for it."""
    seeds: tuple[int, ...]
    """Seeds of each scenario; all machines drive the same, so that luck does not decide."""
    randomization: str = "default"
    camera: str = "projected"
    stuck_s: float | None = 10.0
    """Time in which a car must gain 0.25 m, or its drive ends, s; None: only the time limit of the course ends it."""
    course: Course | None = None
    """The course of all drives, which then differ in their cars and noise alone; None: those of the families."""

    def __post_init__(self) -> None:
        if self.course is None:
            check_families(self.scenarios)
        elif len(self.scenarios) != 1:
            raise ConfigError(f"scenarios = {self.scenarios}: expected one name for the course")
        if self.randomization not in LEVELS:
            raise ConfigError(f"unknown randomization '{self.randomization}': {nearest(self.randomization, LEVELS)}")
        if not self.scenarios or not self.seeds:
            raise ConfigError("expected at least one scenario and one seed")
        check_seeds("seeds", self.seeds)
        one_of("camera", self.camera, CAMERAS)
        if self.stuck_s is not None:
            check_number("stuck_s", self.stuck_s, "s")
            if self.stuck_s <= 0.0:
                raise ConfigError(f"stuck_s = {self.stuck_s!r}: expected a time above 0 s, or None")

    @property
    def courses(self) -> list[SeededCourse]:
        """All courses, the scenarios in turn, so that the first few hold each scenario."""
        return [(scenario, seed) for seed in self.seeds for scenario in self.scenarios]

    def record(self) -> dict[str, Any]:
        """As plain values."""
        plain = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "course"}
        record = {name: list(value) if isinstance(value, tuple) else value for name, value in plain.items()}
        return record if self.course is None else record | {"course": json.loads(self.course.to_json())}


@dataclass(frozen=True, kw_only=True)
class Racing:
    """A race: all candidates drive a few courses, the better ones drive the rest."""

    share: float = 0.25
    """Share of the courses in the first round, in (0, 1]."""
    keep: float = 0.5
    """Share of the candidates that go on after it, in (0, 1]; 1: no race."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            check_number(f"Racing.{field.name}", value)
            if not 0.0 < value <= 1.0:
                raise ConfigError(f"Racing.{field.name} = {value!r}: expected a share above 0, at most 1")

    def rounds(self, courses: Sequence[SeededCourse], scenarios: int) -> list[Sequence[SeededCourse]]:
        """The courses of each round."""
        first = max(math.ceil(self.share * len(courses)), min(scenarios, len(courses)))
        if self.keep >= 1.0 or first >= len(courses):
            return [courses]
        return [courses[:first], courses[first:]]

    def staying(self, candidates: int) -> int:
        """Number of candidates that go on after a round: at least one, if there is one."""
        return math.ceil(self.keep * candidates)

    def drives(self, candidates: int, courses: Sequence[SeededCourse], scenarios: int) -> int:
        """Number of drives of a race."""
        count = 0
        for round_ in self.rounds(courses, scenarios):
            count += candidates * len(round_)
            candidates = self.staying(candidates)
        return count


@dataclass(frozen=True)
class Scored:
    """The drives of a machine, and their cost."""

    drives: tuple[EpisodeResult, ...]
    cost: float
    """Cost; that of a machine that dropped out is at least that of the weakest that did not."""
    full: bool
    """Whether the machine has driven all courses."""


class StageName(StrEnum):
    """The stages of a search and of its report, in their order."""

    AS_IT_WAS = "as it was"
    SEARCH = "search"
    FINALS = "finals"
    CHECK = "check"
    AROUND = "around"
    """Drives around the result."""
    STEPS = "steps"
    """Responses to steps in the wanted clearance."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A stage of a search, and its progress."""

    name: StageName
    done: int
    total: int
    unit: str = "drives"


OnStage = Callable[[Stage], None]


class Evaluator:
    """Lets machines drive on courses; a context manager. The results depend on neither `processes` nor `rows`."""

    def __init__(
        self, task: Task, *, processes: Workers = 1, rows: int = MAX_ROWS, on_stage: OnStage | None = None
    ) -> None:
        """Make an evaluator; the simulation is built at the first drive.

        Args:
            task: families, randomization and camera; the seeds come with each call.
            processes: number of processes, or address of a Dask scheduler whose workers drive.
            rows: largest number of drives at once in each process.
            on_stage: called when a stage begins, and whenever drives of it have ended.
        """
        self.task, self.processes, self.rows = task, processes, rows
        self._on_stage = on_stage
        self._stage = Stage(name=StageName.AS_IT_WAS, done=0, total=0)
        self._runner: BatchRunner | None = None
        self._pool: ProcessPool | None = None
        self._cluster: Cluster | None = None
        self._ended: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the processes; they give up their drives."""
        if self._pool is not None:
            self._pool.close()
            self._pool = None
        if self._cluster is not None:
            self._cluster.close()
            self._cluster = None
        if self._runner is not None:
            self._runner.close()
            self._runner = None

    def stage(self, name: StageName, total: int, done: int = 0) -> None:
        """Begin a stage, for `on_stage`."""
        self._stage = Stage(name=name, done=done, total=total)
        self._count(0)

    def _count(self, ended: int) -> None:
        """Count drives that have ended."""
        self._stage = replace(self._stage, done=self._stage.done + ended)
        if self._on_stage is not None:
            self._on_stage(self._stage)

    def drive(self, machines: Sequence[MachineDefinition], requests: Sequence[EpisodeRequest]) -> list[EpisodeResult]:
        """Results of all requests, in their order."""
        if isinstance(self.processes, str):
            return self._drive_there(self.processes, machines, requests)
        if self.processes == 1 or len(requests) == 1:
            if self._runner is None:
                self._runner = _runner(self.task, self.rows)
            return self._runner.drive(machines, requests, _changes(self._count))
        if self._pool is None:
            self._pool = self._start(self.processes)
        parts = [list(requests[k :: self.processes]) for k in range(self.processes)]
        drives: list[EpisodeResult | None] = [None] * len(requests)
        with worker_losses():
            futures = [self._pool.submit(_drive, list(machines), part) for part in parts]
            self._watch(futures)
            for future in futures:
                if future.done():
                    future.result()  # the error of a process that has failed, before others have driven to the end
            for k, future in enumerate(futures):
                drives[k :: self.processes] = future.result()
        return complete(drives)

    def _start(self, processes: int) -> ProcessPool:
        self._ended = spawned.Value("l", 0)
        return ProcessPool(processes, _begin, self.task, self.rows, self._ended)

    def _drive_there(
        self, address: str, machines: Sequence[MachineDefinition], requests: Sequence[EpisodeRequest]
    ) -> list[EpisodeResult]:
        """Let the workers of a cluster drive."""
        if self._cluster is None:
            self._cluster = Cluster(address)
        count = min(self._cluster.shares, len(requests))
        drives: list[EpisodeResult | None] = [None] * len(requests)

        def keep(k: int, part: list[EpisodeResult]) -> None:
            drives[k::count] = part
            self._count(len(part))

        shares = [Share(self.task, self.rows, tuple(machines), tuple(requests[k::count])) for k in range(count)]
        self._cluster.call_all(drive_share, shares, keep)
        return complete(drives)

    def _watch(self, futures: Sequence[Future[list[EpisodeResult]]]) -> None:
        """Count the drives of the processes until all processes have ended, or one has failed."""
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

    def on_courses(
        self, machines: Sequence[MachineDefinition], courses: Iterable[SeededCourse]
    ) -> list[list[EpisodeResult]]:
        """Results of each machine, in the order of the courses."""
        courses = list(courses)
        # Courses are the outer loop, so that no machine's drives all come last.
        requests = [EpisodeRequest(k, *course) for course in courses for k in range(len(machines))]
        drives = self.drive(machines, requests)
        return [drives[k :: len(machines)] for k in range(len(machines))]

    def race(
        self,
        machines: Sequence[MachineDefinition],
        courses: Sequence[SeededCourse],
        objective: Objective,
        racing: Racing,
    ) -> list[Scored]:
        """Score machines; after the first round the weaker ones drop out.

        Args:
            machines: the candidates.
            courses: courses of all rounds.
            objective: the cost.
            racing: the layout of the rounds.
        """
        first, *more = racing.rounds(courses, len(self.task.scenarios))
        drives = self.on_courses(machines, first)
        costs = [objective.cost(mine) for mine in drives]
        alive = list(range(len(machines)))
        for courses_ in more:
            alive = sorted(sorted(alive, key=lambda k: costs[k])[: racing.staying(len(alive))])
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
        task.scenarios,
        randomization=task.randomization,
        camera=task.camera,
        rows=rows,
        stuck_s=task.stuck_s,
        course=task.course,
    )


def _changes(count: Callable[[int], None]) -> Callable[[int], None]:
    """A function of a growing number that passes on by how much it has grown."""
    before = 0

    def changed(now: int) -> None:
        nonlocal before
        if now > before:
            count(now - before)
            before = now

    return changed


class _Worker:
    """State that a worker keeps from call to call."""

    runner: BatchRunner
    ended: Any


def _begin(task: Task, rows: int, ended: Any) -> None:
    """Prepare a worker."""
    _Worker.runner, _Worker.ended = _runner(task, rows), ended


def _drive(machines: list[MachineDefinition], requests: list[EpisodeRequest]) -> list[EpisodeResult]:
    stop, count = stop_check(), _changes(_add)

    def check(ended: int) -> None:
        stop(ended)
        count(ended)

    return _Worker.runner.drive(machines, requests, check)


@dataclass(frozen=True)
class Share:
    """Drives that a worker of a cluster does at once."""

    task: Task
    rows: int
    machines: tuple[MachineDefinition, ...]
    requests: tuple[EpisodeRequest, ...]


def drive_share(share: Share) -> list[EpisodeResult]:
    """Drive a share in a worker of a cluster, which keeps its simulation as long as the task is the same."""
    wanted = share.task, share.rows
    if getattr(_kept, "made_for", None) != wanted:
        if hasattr(_kept, "runner"):
            _kept.runner.close()
        _kept.runner, _kept.made_for = _runner(*wanted), wanted
    return list(_kept.runner.drive(share.machines, share.requests))


_kept = threading.local()
"""What a worker's thread keeps from share to share: a simulation, and its task and number of rows."""


def _add(ended: int) -> None:
    with _Worker.ended.get_lock():
        _Worker.ended.value += ended
