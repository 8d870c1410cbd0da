"""A search from start to end: generations until the budget is spent, finals, and the held-out check."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tral_env.errors import ConfigError, nearest
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.seeds import stretches
from tral_fsm.formats import library, write
from tral_fsm.tuning.choices import SAMPLERS, Sampler
from tral_fsm.tuning.evaluator import Evaluator, OnStage, Racing, Scored, SeededCourse, Task
from tral_fsm.tuning.found import Tuned, best_of, save
from tral_fsm.tuning.holdout import compare
from tral_fsm.tuning.journal import Journal
from tral_fsm.tuning.objective import Objective, parts
from tral_fsm.tuning.parameters import Parameter, allowed, apply, find
from tral_fsm.tuning.search.cma_es import CmaSearch
from tral_fsm.tuning.search.optuna import OBJECTIVES, OptunaSearch, front
from tral_fsm.tuning.search.space import Search, Trial, Values


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a search."""

    budget: int = 3000
    """Number of drives of the search; the last generation is finished. Finals and held-out check are extra."""
    sampler: Sampler = "cmaes"
    """"cmaes", or a sampler of Optuna, which is the extra `tune`: "tpe", "nsga2", "random"."""
    objectives: tuple[str, ...] = ()
    """Two or more of "clearance", "time", "steering" for a Pareto front; they need "nsga2"."""
    population: int | None = None
    """Number of candidates of a generation, at least 4; None: by the number of parameters."""
    racing: Racing = field(default_factory=Racing)
    finalists: int = 4
    """Number of the best candidates that drive again on fresh courses, so that the luckiest does not win."""
    final_seeds: int | None = None
    """Number of seeds of the finals, which follow those of the search; None: twice as many as these."""
    report_seeds: tuple[int, ...] = tuple(range(500, 600))
    """Seeds of the held-out check; empty: no check."""
    seed: int = 0
    """Seed of the sampler."""

    def __post_init__(self) -> None:
        for name, low in (("budget", 1), ("finalists", 1), ("final_seeds", 1), ("population", 4), ("seed", 0)):
            value = getattr(self, name)
            if value is None and name in ("final_seeds", "population"):
                continue
            if not isinstance(value, int) or value < low:
                raise ConfigError(f"{name} = {value!r}: expected a whole number, {low} or more")
        if self.sampler not in SAMPLERS:
            raise ConfigError(f"unknown sampler '{self.sampler}': {nearest(self.sampler, SAMPLERS)}")
        self._check_objectives()

    def _check_objectives(self) -> None:
        for name in self.objectives:
            if name not in OBJECTIVES:
                raise ConfigError(f"unknown objective '{name}'. Allowed: {', '.join(OBJECTIVES)}")
        if self.objectives and self.sampler != "nsga2":
            raise ConfigError(f"objectives = {','.join(self.objectives)}: several need the sampler nsga2")
        if len(self.objectives) == 1 or len({*self.objectives}) < len(self.objectives):
            raise ConfigError(f"objectives = {','.join(self.objectives)}: expected two or more different ones, or none")


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Progress of a search."""

    generation: int
    drives: int
    budget: int
    best: Trial
    old: Trial


class Study:
    """One search."""

    def __init__(
        self,
        machine: MachineDefinition,
        parameters: list[Parameter],
        task: Task,
        objective: Objective,
        settings: Settings,
        *,
        out: Path | None = None,
        resume: bool = False,
        storage: str | None = None,
    ) -> None:
        """Prepare a search; see `tune` for the arguments."""
        self.machine, self.parameters, self.task = machine, parameters, task
        self.objective, self.settings, self.out = objective, settings, out
        header = self.header()
        self.shared: OptunaSearch | None = None
        self.search: Search
        if settings.sampler == "cmaes":
            if storage is not None:
                raise ConfigError("--storage is Optuna's: choose --sampler tpe, nsga2 or random with it")
            self.search = CmaSearch(parameters, seed=settings.seed, population=settings.population)
        else:
            self.search = self.shared = OptunaSearch(
                parameters,
                settings.sampler,
                seed=settings.seed,
                population=settings.population,
                objectives=settings.objectives,
                weights=objective.weights,
                storage=storage,
                header=header,
            )
        self.in_storage = storage is not None
        self.journal = Journal(None if self.in_storage else out, header, resume=resume and not self.in_storage)
        for trials in self.journal.generations:
            self._replay(trials)

    def _replay(self, trials: list[Trial]) -> None:
        """Tell the searcher a generation of the file."""
        asked = self.search.ask()
        if [each.values for each in trials] != asked:
            raise ConfigError(
                f"{self.journal.path}: the study was written by another version of the sampler: begin a new one"
            )
        self.search.tell(trials)

    def header(self) -> dict[str, Any]:
        """All that decides the result of a search, but for the budget, which may grow."""
        settings = self.settings
        whole = {
            "machine": write(self.machine, "json"),
            "parameters": [each.record() for each in self.parameters],
            "task": self.task.record(),
            "weights": self.objective.weights.record(),
            "pooling": [self.objective.pooling, self.objective.tail],
            "racing": [settings.racing.share, settings.racing.keep],
            "sampler": [settings.sampler, settings.seed, settings.population, list(settings.objectives)],
        }
        plain: dict[str, Any] = json.loads(json.dumps(whole))
        return plain

    @property
    def trials(self) -> list[Trial]:
        """All candidates so far."""
        if self.in_storage and self.shared is not None:
            return self.shared.trials
        return [each for generation in self.journal.generations for each in generation]

    def generation(self, evaluator: Evaluator) -> list[Trial]:
        """Ask, drive, tell."""
        asked = self.search.ask()
        fitting = [values for values in asked if allowed(self.machine, self.parameters, values)]
        if not fitting:
            apply(self.machine, self.parameters, asked[0])  # it raises an error that tells the fault
        machines = [apply(self.machine, self.parameters, values) for values in fitting]
        racing = Racing(keep=1.0) if self.settings.objectives else self.settings.racing
        scored = evaluator.race(machines, self.task.courses, self.objective, racing)
        results, worst = iter(scored), max(each.cost for each in scored)
        trials = [
            _trial(values, next(results)) if values in fitting else self._refused(values, worst) for values in asked
        ]
        self.search.tell(trials)
        self.journal.add(trials)
        return trials

    def _refused(self, values: Values, worst: float) -> Trial:
        """Trial of a candidate that the definition does not allow; it costs as much as the worst, and as a failure."""
        weights, nothing = self.objective.weights, (1.0, 1.0, 0.0, 0.0, 0.0)
        cost = max(worst, weights.failure + weights.unfinished)
        return Trial(values=values, cost=cost, full=False, drives=0, successes=0, parts=nothing)


def _trial(values: Values, scored: Scored) -> Trial:
    return Trial(
        values=values,
        cost=scored.cost,
        full=scored.full,
        drives=len(scored.drives),
        successes=sum(drive.success for drive in scored.drives),
        parts=tuple(np.mean([parts(drive) for drive in scored.drives], axis=0).tolist()),
    )


def tune(
    machine: MachineDefinition | str | Path,
    params: Sequence[str],
    task: Task,
    *,
    objective: Objective | None = None,
    settings: Settings | None = None,
    tie: bool = False,
    processes: int | None = None,
    out: Path | None = None,
    resume: bool = False,
    storage: str | None = None,
    origin: str = "tral_fsm.tuning.tune",
    on_progress: Callable[[Progress], None] | None = None,
    on_stage: OnStage | None = None,
) -> Tuned:
    """Search parameters of a machine, as `tral tune` does.

    Args:
        machine: a definition, the name of a packaged machine, or a file.
        params: patterns of parameters, see `parameters.find`.
        task: courses, cars and sensors of the drives.
        objective: cost of drives, and their pooling.
        settings: settings of the search.
        tie: give all parameters of one pattern the same value.
        processes: number of processes; None: one for each core. The result does not depend on it.
        out: folder of study.jsonl and machine.json, both up to date after each generation; None: no files.
        resume: go on with the study in `out`.
        storage: database URL or journal file that other processes may use too.
        origin: command line, for the description of the machine.
        on_progress: called after each generation.
        on_stage: called whenever drives have ended, with their stage: "as it was", "search", "finals", "check".

    Returns:
        The result. A KeyboardInterrupt is passed on; `out` then holds the result so far.

    Raises:
        ConfigError: an argument cannot be used.
        MachineError: the machine cannot be read or run.
        MissingExtraError: a sampler of Optuna lacks the extra `tune`.
    """
    definition = machine if isinstance(machine, MachineDefinition) else library.load(machine)
    objective, settings = objective or Objective(), settings or Settings()
    check_apart(task, settings)
    parameters = find(definition, list(params), tie=tie)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    study = Study(definition, parameters, task, objective, settings, out=out, resume=resume, storage=storage)
    began = time.perf_counter()
    processes = processes or os.cpu_count() or 1
    with Evaluator(task, processes=processes, on_stage=on_stage) as evaluator:
        tuned = _search(study, evaluator, origin, on_progress)
        _finals(study, tuned, evaluator)
    if settings.report_seeds:
        _hold_out(study, tuned, processes, on_stage)
    tuned.complete, tuned.seconds = True, time.perf_counter() - began
    if out is not None:
        save(tuned, out / "machine.json", origin)
    return tuned


def check_apart(task: Task, settings: Settings) -> None:
    """Refuse seeds of the held-out check that the search or its finals use.

    Raises:
        ConfigError: there are such seeds.
    """
    both = {*task.seeds, *final_seeds(task, settings)} & {*settings.report_seeds}
    if both:
        raise ConfigError(f"seeds {stretches(both)} are for tuning and for the report: choose other --report-seeds")


def final_seeds(task: Task, settings: Settings) -> tuple[int, ...]:
    """Seeds of the finals, which follow those of the search."""
    after = max(task.seeds) + 1
    count = 2 * len(task.seeds) if settings.final_seeds is None else settings.final_seeds
    return tuple(range(after, after + count))


def _search(study: Study, evaluator: Evaluator, origin: str, on_progress: Callable[[Progress], None] | None) -> Tuned:
    """Generations until the budget is spent."""
    task, settings = study.task, study.settings
    evaluator.stage("as it was", len(task.courses))
    (old,) = evaluator.race([study.machine], task.courses, study.objective, Racing(keep=1.0))
    old_trial = _trial((), old)
    while True:
        trials = study.trials
        drives = sum(each.drives for each in trials)
        if any(each.full for each in trials):
            best = best_of(trials)
            tuned = _found(study, best.values, old_trial, trials)
            if study.out is not None:
                save(tuned, study.out / "machine.json", origin)
            if on_progress is not None:
                count = len(study.journal.generations)
                on_progress(Progress(generation=count, drives=drives, budget=settings.budget, best=best, old=old_trial))
            if drives >= settings.budget:
                return tuned
        evaluator.stage("search", settings.budget, drives)
        study.generation(evaluator)


def _found(study: Study, values: Values | None, old_trial: Trial, trials: list[Trial]) -> Tuned:
    new = study.machine if values is None else apply(study.machine, study.parameters, values)
    objectives = study.settings.objectives or OBJECTIVES
    return Tuned(
        old=study.machine,
        new=new,
        parameters=study.parameters,
        values=values,
        old_trial=old_trial,
        trials=trials,
        generations=[len(each) for each in study.journal.generations],
        front=front(trials, objectives, study.objective.weights),
        objectives=objectives,
    )


def _finals(study: Study, tuned: Tuned, evaluator: Evaluator) -> None:
    """Let the best of the search and the old machine drive once more, on courses that are new to all of them."""
    ranked = sorted((each for each in tuned.trials if each.full), key=lambda each: each.cost)
    values: list[Values | None] = [None]
    for each in ranked:
        if each.values not in values and len(values) <= study.settings.finalists:
            values.append(each.values)
    seeds = final_seeds(study.task, study.settings)
    courses: list[SeededCourse] = [(scenario, seed) for seed in seeds for scenario in study.task.scenarios]
    machines = [study.machine if each is None else apply(study.machine, study.parameters, each) for each in values]
    evaluator.stage("finals", len(machines) * len(courses))
    costs = [study.objective.cost(drives) for drives in evaluator.on_courses(machines, courses)]
    tuned.finals = list(zip(values, costs, strict=True))
    tuned.values, _ = min(tuned.finals, key=lambda each: each[1])
    tuned.new = machines[values.index(tuned.values)]


def _hold_out(study: Study, tuned: Tuned, processes: int, on_stage: OnStage | None) -> None:
    """Let the old and the new machine drive the courses of the held-out check, up to the time limit."""
    task = Task(
        scenarios=study.task.scenarios,
        seeds=study.settings.report_seeds,
        randomization=study.task.randomization,
        camera=study.task.camera,
        stuck_s=None,
    )
    with Evaluator(task, processes=processes, on_stage=on_stage) as evaluator:
        evaluator.stage("check", 2 * len(task.courses))
        tuned.old_drives, tuned.new_drives = evaluator.on_courses([tuned.old, tuned.new], task.courses)
    tuned.comparison = compare(tuned.old_drives, tuned.new_drives, study.objective)
