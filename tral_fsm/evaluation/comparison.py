"""All contenders drive all courses of a suite; each drive is a line of a file as soon as it ends."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils.seeding import np_random
from numpy.typing import NDArray

from tral_env.course.generate import generate_plan
from tral_env.course.plan import Plan
from tral_env.errors import ConfigError
from tral_env.interface import Policy
from tral_env.randomization import level as level_of
from tral_env.se2 import rotate_back
from tral_env.world import Step, World
from tral_fsm.evaluation import rollout
from tral_fsm.evaluation.analysis import LAST_POSES
from tral_fsm.evaluation.batch import MAX_ROWS, BatchRunner
from tral_fsm.evaluation.cluster import Cluster, Workers
from tral_fsm.evaluation.contenders import Agent, Contender, require_different_names, row_policies
from tral_fsm.evaluation.episode import Episode, EpisodeRequest, EpisodeResult
from tral_fsm.evaluation.loop import Index, Observer
from tral_fsm.evaluation.pool import call_all, stop_check, tell
from tral_fsm.evaluation.records import Bar, Record, append, begin_run, held, made_with
from tral_fsm.evaluation.row_policies import MixedPolicies, RowPolicies
from tral_fsm.evaluation.suites import Suite

RECORDS = "records.jsonl"
"""The drives of a comparison lie in this file of its folder."""
JOB_DRIVES = 4 * MAX_ROWS
"""Largest number of drives of a job. Source: choice; at its end some rows of the batch stand still."""
PATH_TICKS = 8
"""A path has a pose each so many ticks: ten a second."""


@dataclass(frozen=True, kw_only=True)
class ComparisonSettings:
    """What all drives of a file have in common; the number of courses may grow."""

    suite: str
    families: str
    levels: str
    split: str
    camera: str

    @classmethod
    def of(cls, suite: Suite) -> ComparisonSettings:
        """Settings of a suite."""
        return cls(
            suite=suite.name,
            families=",".join(suite.families),
            levels=",".join(suite.levels),
            split=suite.split,
            camera=suite.camera,
        )


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One drive to do."""

    contender: str
    agent: Agent
    family: str
    seed: int


@dataclass(frozen=True, kw_only=True)
class Job:
    """Drives on one level of randomization, of any agents: they share a batch."""

    suite: Suite
    level: str
    entries: tuple[Entry, ...]


def drive_field(
    suite: Suite,
    field: Sequence[Contender],
    out: Path,
    processes: Workers = 1,
    progress: Bar | None = None,
) -> list[Record]:
    """Drive what the records do not hold yet.

    Args:
        suite: the courses.
        field: the contenders.
        out: folder of the records.
        processes: number of processes that drive; 1: this one. Or the address of a Dask scheduler whose workers drive.
        progress: makes a bar of the drives; None: no bar.

    Returns:
        The records of all drives of the suite and the field, and the lines of the runs that made them.

    Raises:
        ConfigError: the records were made with another suite, a contender has changed since, another run writes into
            the folder, or the field cannot be driven so.
        TralError: a contender fails.
    """
    _check(field, processes)
    path, settings = out / RECORDS, ComparisonSettings.of(suite)
    digests = {f"{one.name}: {agent.source}": agent.digest for one in field for agent in one.agents}
    with held(path), contextlib.ExitStack() as stack:
        workers = stack.enter_context(Cluster(processes)) if isinstance(processes, str) else processes
        parts = workers.shares if isinstance(workers, Cluster) else workers
        jobs = list(missing(suite, field, made_with(path, settings, digests), parts))
        if jobs:
            begin_run(path, settings, digests)
            bar = progress or (lambda _: contextlib.nullcontext(lambda: None))
            _drive(jobs, path, workers, bar)
        return wanted(suite, field, made_with(path, settings, digests))


def _check(field: Sequence[Contender], processes: Workers) -> None:
    """Refuse a field whose drives would be mixed up.

    Raises:
        ConfigError: two contenders have one name, two agents share one object, or an object shall drive in other
            processes.
    """
    require_different_names(field)
    objects = [agent for one in field for agent in one.agents if agent.kind == "object"]
    if objects and processes != 1:
        raise ConfigError(f"agent '{objects[0].source}' is an object of this program: expected processes=1")
    for k, agent in enumerate(objects):
        for other in objects[:k]:
            if agent.policy is other.policy:
                raise ConfigError(
                    f"agents '{other.source}' and '{agent.source}' are one object: expected an object for each, "
                    "because both drive at once"
                )


def _drive(jobs: Sequence[Job], path: Path, workers: int | Cluster, bar: Bar) -> None:
    """Drive, here, in other processes or on a cluster; each drive is kept as it ends."""
    with bar(sum(len(job.entries) for job in jobs)) as count:

        def keep(line: Record) -> None:
            append(path, line)
            count()

        def keep_all(_: int, lines: list[Record]) -> None:
            for line in lines:
                keep(line)

        if isinstance(workers, Cluster):
            workers.call_all(drive_there, jobs, keep_all)
        elif workers == 1:
            _drive_here(jobs, keep)
        else:
            call_all(drive, jobs, workers, keep)


def key(line: Record) -> tuple[str, str, str, str, int]:
    """What tells a drive from all others."""
    return line["contender"], line["agent"], line["level"], line["scenario"], line["seed"]


def wanted(suite: Suite, field: Sequence[Contender], lines: Sequence[Record]) -> list[Record]:
    """The lines of runs, and those of drives that belong to the suite and the field."""
    agents = {(one.name, agent.source) for one in field for agent in one.agents}
    return [
        line
        for line in lines
        if line["kind"] == "run" or ((line["contender"], line["agent"]) in agents and line["seed"] in suite.seeds)
    ]


def missing(suite: Suite, field: Sequence[Contender], lines: Sequence[Record], processes: int = 1) -> Iterator[Job]:
    """Jobs for the drives that have no line, at least one for each process if there are enough drives.

    All agents take their turns on each course, so that they share a batch. One that has more courses than a batch has
    rows drives alone: a network decides for all rows of its batch, also for those of others.
    """
    done = {key(line) for line in lines if line["kind"] == "drive"}
    agents = [(one.name, agent) for one in field for agent in one.agents]
    for level in suite.levels:
        entries = [
            Entry(contender=name, agent=agent, family=family, seed=seed)
            for seed in suite.seeds
            for family in suite.families
            for name, agent in agents
            if (name, agent.source, level, family, seed) not in done
        ]
        if len(suite.seeds) * len(suite.families) >= MAX_ROWS:
            order = {(name, agent.source): k for k, (name, agent) in enumerate(agents)}
            entries.sort(key=lambda entry: order[entry.contender, entry.agent.source])
        size = min(JOB_DRIVES, max(-(-len(entries) * len(suite.levels) // processes), 1))
        for k in range(0, len(entries), size):
            yield Job(suite=suite, level=level, entries=tuple(entries[k : k + size]))


def _drive_here(jobs: Sequence[Job], keep: Callable[[Record], None]) -> None:
    """Drive in this process; jobs of one level share a simulation."""
    with contextlib.ExitStack() as stack:
        runners: dict[str, BatchRunner] = {}
        for job in jobs:
            if job.level not in runners:
                runners[job.level] = stack.enter_context(contextlib.closing(runner_of(job)))
            run(job, runners[job.level], keep)


def runner_of(job: Job) -> BatchRunner:
    """The simulation of a job."""
    return BatchRunner(job.suite.families, randomization=job.level, camera=job.suite.camera)


def drive(job: Job) -> None:
    """Drive a job in a process of its own, which tells the line of each drive as it ends."""
    with contextlib.closing(runner_of(job)) as runner:
        run(job, runner, tell)


def drive_there(job: Job) -> list[Record]:
    """Drive a job in a worker of a cluster; give the lines of its drives."""
    lines: list[Record] = []
    with contextlib.closing(runner_of(job)) as runner:
        run(job, runner, lines.append)
    return lines


def run(job: Job, runner: BatchRunner, keep: Callable[[Record], None]) -> None:
    """Drive a job; `keep` gets the line of each drive as it ends."""
    agents = {(one.contender, one.agent.source): one.agent for one in job.entries}
    number = {which: k for k, which in enumerate(agents)}
    requests = [EpisodeRequest(number[one.contender, one.agent.source], one.family, one.seed) for one in job.entries]

    def make(world: World) -> RowPolicies:
        return MixedPolicies([row_policies(agent, world) for agent in agents.values()], world.n)

    runner.drive_with(make, requests, stop_check(), spectator=_Watcher(job, keep))


class _Watcher:
    """Keeps paths and the places where gates were passed, and makes the line of each drive."""

    def __init__(self, job: Job, keep: Callable[[Record], None]) -> None:
        self._job, self._keep = job, keep
        self._paths: dict[int, list[list[float]]] = {}
        self._offsets: dict[int, list[float]] = {}
        self._ticks = np.zeros(len(job.entries), np.int64)
        self._passed = np.zeros(len(job.entries), np.int64)

    def watch(self, rows: Index, numbers: Index, world: World, step: Step) -> None:
        """See a tick."""
        pose, passed = step.info["pose"][rows], step.info["gates_passed"][rows]
        over = (step.terminated | step.truncated)[rows]
        due = over | (self._ticks[numbers] % PATH_TICKS == 0)
        for number, place in zip(numbers[due].tolist(), pose[due].tolist(), strict=True):
            self._paths.setdefault(number, []).append([round(value, 3) for value in place])
        for k in np.flatnonzero(passed > self._passed[numbers]).tolist():
            gate = world.track.gate_pose[rows[k], passed[k] - 1]
            self._offsets.setdefault(int(numbers[k]), []).append(round(gate_offset(gate, pose[k]), 4))
        self._ticks[numbers] += 1
        self._passed[numbers] = passed

    def finish(self, number: int, result: EpisodeResult) -> None:
        """Make the line of a drive."""
        entry, path = self._job.entries[number], self._paths.pop(number, [])
        record = {
            "kind": "drive",
            "contender": entry.contender,
            "agent": entry.agent.source,
            "level": self._job.level,
            **result.record(),
            "gate_offsets_m": self._offsets.pop(number, []),
        }
        if entry.seed == self._job.suite.seeds[0]:
            record["path"] = path
        elif not result.success:
            record["path"] = path[-LAST_POSES:]
        self._keep(record)


def gate_offset(gate: NDArray[np.floating], pose: NDArray[np.floating]) -> float:
    """How far left of a gate's middle a car passes it, m; both are (3,) x, y [m], yaw [rad]."""
    _, left = rotate_back(
        float(np.cos(gate[2])), float(np.sin(gate[2])), float(pose[0] - gate[0]), float(pose[1] - gate[1])
    )
    return left


def drive_again(
    failure: Mapping[str, Any], suite: Suite, policy: Policy, watcher: Callable[[Any], Observer]
) -> Episode:
    """Drive a failure of an analysis once more in an environment that renders.

    Args:
        failure: one of "failures" of `analysis.analyse`.
        suite: the suite that it belongs to.
        policy: the policy that failed.
        watcher: makes, from the environment, what is called with each tick.
    """
    with contextlib.closing(
        gym.make(
            "tral_env:TralCorridor-v0",
            scenario=failure["scenario"],
            randomization=failure["level"],
            camera=suite.camera,
            render_mode="rgb_array",
        )
    ) as env:
        return rollout.drive(env, policy, failure["seed"], on_step=watcher(env.unwrapped), scenario=failure["scenario"])


def plans_of(shown: Mapping[str, Any]) -> dict[tuple[str, str, int], Plan]:
    """Plans of the courses of all paths and failures that an analysis shows: family, level, seed -> plan."""
    keys = {(one["family"], one["level"], one["seed"]) for one in shown["paths"]}
    keys |= {(one["scenario"], one["level"], one["seed"]) for one in shown["failures"]}
    return {
        (family, level, seed): generate_plan(family, np_random(seed)[0], hard=level_of(level).hard_courses)[1]
        for family, level, seed in sorted(keys)
    }
