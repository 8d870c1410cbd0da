"""Many drives in one batch: each row has a machine of its own, and takes the next drive as soon as one ends.

A drive is the one of `rollout.drive` with the same scenario and seed, whatever the other rows do.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from tral_env.course.generate import generate_plan
from tral_env.course.scene import Pool
from tral_env.randomization import level
from tral_env.world import CorridorConfig, Drawn, Step, World
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.estimation.estimator import COLUMNS, MachineState
from tral_fsm.evaluation.metrics import clearance_error
from tral_fsm.evaluation.rollout import Result, outcome
from tral_fsm.evaluation.settling import Settling
from tral_fsm.runtime.machine import Machine

Array = NDArray[np.float64]

ROWS = 128
"""Drives at once. Source: measured; from here on a row costs little less, and the last drives end later."""
STUCK_M = 0.25
"""Who gains less along the route than this, in the time a stuck car is given, is stuck. Source: choice."""
ERROR_BINS = np.linspace(-0.5, 0.5, 101)
"""Edges of the histogram of clearance errors, m; what is beyond is counted in the outermost bins."""
_SEEN = len(COLUMNS)
_SUMS = ("squares", "samples", "settled_squares", "settled_samples", "lateral", "speed", "steering", "ticks")


@dataclass(frozen=True)
class Job:
    """One drive that is wanted."""

    machine: int
    """Index of the machine that drives."""
    scenario: str
    seed: int


@dataclass(frozen=True, kw_only=True)
class Drive(Result):
    """How one drive of a fleet went."""

    route_m: float
    """Length of the route."""
    steering_travel: float
    """Sum of the changes of the steering command, either way: from full right to full left is 2."""
    errors: NDArray[np.int64] = field(repr=False, compare=False)
    """(100,) ticks by clearance error, in the bins of `ERROR_BINS`."""

    def record(self) -> dict[str, Any]:
        """The numbers fit for JSON and for `report.summary.summarize`: what could not be measured is None."""
        own = {"route_m": round(self.route_m, 3), "steering_travel": round(self.steering_travel, 4)}
        return super().record() | own


class Fleet:
    """Rows of cars that drive whatever machine on whatever course comes next."""

    def __init__(
        self,
        scenarios: Sequence[str],
        *,
        randomization: str = "default",
        camera: str = "projected",
        rows: int = ROWS,
        nthread: int = 1,
        stuck_s: float | None = None,
    ) -> None:
        """Build the simulation.

        Args:
            scenarios: families of courses that will be driven.
            randomization: how much cars and sensors differ.
            camera: "projected" or "rendered".
            rows: drives at once.
            nthread: threads that step the cars.
            stuck_s: who has gained less than `STUCK_M` in this time has timed out, s; None: only at the time limit.

        Raises:
            ConfigError: unknown scenario, camera or randomization.
        """
        configs = [CorridorConfig(scenario=name, randomization=randomization, camera=camera) for name in scenarios]
        pool = Pool(0)
        for name in scenarios:
            pool = pool.union(Pool.for_scenario(name))
        self.rows = rows
        self.world = World(rows, configs[0], nthread=nthread, pool=pool)
        self._randomization, self._hard = level(randomization), randomization == "hard"
        self._patience = math.inf if stuck_s is None else stuck_s
        self._drawn: dict[tuple[str, int], tuple[Drawn, np.random.Generator]] = {}
        self._rngs = [np.random.default_rng(0)] * rows
        self._started = False

    def drive(
        self,
        machines: Sequence[MachineDefinition],
        jobs: Sequence[Job],
        on_tick: Callable[[int], None] | None = None,
    ) -> list[Drive]:
        """Drive all jobs.

        Args:
            machines: what the jobs choose from.
            jobs: the drives, in the order in which they begin.
            on_tick: called each tick with the number of drives that have ended; may raise to break off.

        Returns:
            How each job went, in the order of the jobs.

        Raises:
            FormatError: a machine cannot run.
            SimulationError: the physics of a car became unstable.
        """
        if not jobs:
            return []
        run = _Run(self, machines, jobs)
        run.fill(np.arange(min(self.rows, len(jobs))))
        while run.active.size:
            run.tick()
            if on_tick is not None:
                on_tick(run.ended)
        return [drive for drive in run.drives if drive is not None]

    def draw(self, job: Job) -> tuple[Drawn, np.random.Generator]:
        """Course and car of a job, and the generator of its noise; drawn once, since many machines drive the same."""
        key = job.scenario, job.seed
        if key not in self._drawn:
            rng = seeding.np_random(job.seed)[0]
            course, plan = generate_plan(job.scenario, rng, hard=self._hard)
            self._drawn[key] = Drawn(course, plan, self._randomization.draw(rng)), rng
        drawn, rng = self._drawn[key]
        return drawn, copy.deepcopy(rng)

    def begin(self, rows: NDArray[np.int64], jobs: Sequence[Job]) -> None:
        """Put the cars of the rows at the start of their jobs."""
        fresh = [self.draw(job) for job in jobs]
        for row, (_, rng) in zip(rows, fresh, strict=True):
            self._rngs[row] = rng
        drawn = [each for each, _ in fresh]
        if not self._started:  # the first time all rows need a course; those without a job never move
            spare = self.rows - len(rows)
            rows, drawn = np.append(rows, np.arange(self.rows - spare, self.rows)), drawn + drawn[:1] * spare
            self._started = True
        self.world.begin(rows, drawn, self._rngs)

    def is_stuck(self, waited: Array) -> NDArray[np.bool_]:
        """Who has waited too long, (n,), given the time without progress [s]."""
        return waited > self._patience

    def close(self) -> None:
        """Free what OpenGL holds."""
        self.world.close()


class _Run:
    """The state of one call of `Fleet.drive`."""

    def __init__(self, fleet: Fleet, machines: Sequence[MachineDefinition], jobs: Sequence[Job]) -> None:
        self.fleet, self.jobs, self.definitions = fleet, jobs, machines
        n = fleet.rows
        self.drives: list[Drive | None] = [None] * len(jobs)
        self.active = np.zeros(0, np.int64)
        """Rows that drive, ascending."""
        self.ended = 0
        self._next = 0
        self._job = np.full(n, -1)
        self._machines: list[Machine | None] = [None] * n
        self._states = [MachineState()] * n
        self._idle: dict[int, list[Machine]] = {}
        self._command = np.zeros((n, 2), np.float32)
        self._wanted = np.full((n, 2), np.nan)
        self._steering, self._best, self._since = np.zeros(n), np.zeros(n), np.zeros(n)
        self._sums = {name: np.zeros(n) for name in _SUMS}
        self._errors = np.zeros((n, len(ERROR_BINS) - 1), np.int64)
        self._settling = Settling(n)

    def fill(self, free: NDArray[np.int64]) -> None:
        """Give the next jobs to free rows."""
        rows = free[: len(self.jobs) - self._next]
        if rows.size:
            numbers = range(self._next, self._next + len(rows))
            self._next += len(rows)
            self.fleet.begin(rows, [self.jobs[k] for k in numbers])
            for row, k in zip(rows, numbers, strict=True):
                self._job[row] = k
                self._machines[row] = self._machine(self.jobs[k].machine)
                self._states[row] = MachineState()
            for values in (*self._sums.values(), self._steering, self._best, self._since):
                values[rows] = 0.0
            self._errors[rows] = 0
            self._settling.begin(rows)
        self.active = np.flatnonzero(self._job >= 0)
        self._observation = self.fleet.world.observation()

    def _machine(self, index: int) -> Machine:
        """A machine that begins anew."""
        idle = self._idle.setdefault(index, [])
        machine = idle.pop() if idle else Machine(self.definitions[index])
        machine.restart()
        return machine

    def tick(self) -> None:
        """Drive all rows for one tick."""
        self._act()
        world = self.fleet.world
        step = world.step(self._command, None if len(self.active) == self.fleet.rows else self.active)
        self._observation = step.observation
        self._add(step)
        over = step.terminated | step.truncated | self.fleet.is_stuck(step.info["time_s"] - self._since)
        done = self.active[over[self.active]]
        if done.size:
            for row in done:
                self._finish(int(row), step)
            self.fill(done)

    def _act(self) -> None:
        """Let the machines decide."""
        commands, wanted = [], []
        for row, readings in zip(self.active, self._observation[self.active, :_SEEN].tolist(), strict=True):
            m, machine = self._states[row], self._machines[row]
            assert machine is not None
            m.update(readings)
            machine.tick(m)
            commands.append((m.steering, m.throttle))
            wanted.append((m.wanted_side, m.wanted_clearance))
        self._command[self.active] = commands
        self._wanted[self.active] = wanted

    def _add(self, step: Step) -> None:
        """Add a tick to the sums."""
        rows, info, sums = self.active, step.info, self._sums
        left, right, speed = (
            np.asarray(info[name][rows], np.float64) for name in ("clearance_left_m", "clearance_right_m", "speed_mps")
        )
        error = clearance_error(left, right, self._wanted[rows])
        known = np.isfinite(error)
        settled = self._settling.add(rows, self._wanted[rows], error, speed)
        for name, counts in (("", known), ("settled_", settled)):
            sums[name + "squares"][rows] += np.where(counts, error, 0.0) ** 2
            sums[name + "samples"][rows] += counts
        bins = np.clip(np.searchsorted(ERROR_BINS, error[known], "right") - 1, 0, len(ERROR_BINS) - 2)
        self._errors[rows[known], bins] += 1
        sums["lateral"][rows] += info["lateral_offset_m"][rows] ** 2
        sums["speed"][rows] += speed
        steering = self.fleet.world.sim.command[rows, 0]
        sums["steering"][rows] += np.abs(steering - self._steering[rows])
        sums["ticks"][rows] += 1
        self._steering[rows] = steering
        gained = info["progress"] * self.fleet.world.track.length
        ahead = gained > self._best + STUCK_M
        self._best = np.where(ahead, gained, self._best)
        self._since = np.where(ahead, info["time_s"], self._since)

    def _finish(self, row: int, step: Step) -> None:
        """Write down how the drive of a row went."""
        info = {name: values[row] for name, values in step.info.items()}
        sums = {name: float(values[row]) for name, values in self._sums.items()}
        number = int(self._job[row])
        job, ticks = self.jobs[number], sums["ticks"]
        self.drives[number] = Drive(
            scenario=job.scenario,
            seed=job.seed,
            outcome=outcome(info),
            crash=bool(info["crash"]),
            progress=float(info["progress"]),
            route_m=float(self.fleet.world.track.length[row]),
            time_s=float(info["time_s"]),
            mean_speed=sums["speed"] / ticks,
            clearance_rmse=_root_mean(sums["squares"], sums["samples"]),
            clearance_samples=int(sums["samples"]),
            settled_rmse=_root_mean(sums["settled_squares"], sums["settled_samples"]),
            settled_samples=int(sums["settled_samples"]),
            lateral_rms=math.sqrt(sums["lateral"] / ticks),
            steering_travel=sums["steering"],
            gates_passed=int(info["gates_passed"]),
            gates_total=int(info["gates_total"]),
            errors=self._errors[row].copy(),
        )
        machine = self._machines[row]
        assert machine is not None
        self._idle[job.machine].append(machine)
        self._job[row] = -1
        self.ended += 1


def _root_mean(squares: float, samples: float) -> float:
    return math.sqrt(squares / samples) if samples else math.nan
