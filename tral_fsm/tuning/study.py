"""A search from start to end: generations until the budget is spent, finals, and the held-out check."""

from __future__ import annotations

import itertools
import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tral_env.checks import check_number
from tral_env.errors import ConfigError, nearest
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.cluster import Workers
from tral_fsm.evaluation.folder import held
from tral_fsm.evaluation.seeds import check_seeds, stretches
from tral_fsm.formats import library, write
from tral_fsm.tuning.choices import SAMPLERS, Sampler
from tral_fsm.tuning.evaluator import Evaluator, OnStage, Racing, Scored, SeededCourse, StageName, Task
from tral_fsm.tuning.folder import MACHINE, RESULTS, aside_said
from tral_fsm.tuning.found import Tuned, best_of, save
from tral_fsm.tuning.holdout import compare
from tral_fsm.tuning.journal import Journal
from tral_fsm.tuning.objective import Objective, parts
from tral_fsm.tuning.parameters import Parameter, allowed, apply, find
from tral_fsm.tuning.search.cma_es import CmaSearch
from tral_fsm.tuning.search.optuna import OBJECTIVES, OptunaSearch, front
from tral_fsm.tuning.search.space import Search, Trial, Values

OnNote = Callable[[str], None]
"""Called with a sentence that the user should know."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a search."""

    budget: int = 3000
    """Largest number of drives of the search; the last generation has as many candidates as still fit. Finals and
    held-out check are extra."""
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
            check_number(name, value, whole=True)
            if value < low:
                raise ConfigError(f"{name} = {value!r}: expected a whole number, {low} or more")
            object.__setattr__(self, name, int(value))  # not that of NumPy, which JSON does not take
        if not isinstance(self.racing, Racing):
            raise ConfigError(f"racing = {self.racing!r}: expected a Racing")
        check_seeds("report_seeds", self.report_seeds)
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

    @property
    def better(self) -> bool:
        """Whether the best candidate costs less than the machine as it was."""
        return self.best.cost < self.old.cost


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
        on_note: OnNote = lambda said: None,
    ) -> None:
        """Prepare a search; see `tune` for the arguments."""
        self.machine, self.parameters, self.task = machine, parameters, task
        self.objective, self.settings, self.out = objective, settings, out
        self.racing = Racing(keep=1.0) if settings.objectives else settings.racing
        self._pending: list[Values] | None = None
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
                on_note=on_note,
            )
        self.in_storage = storage is not None
        if self.in_storage and out is not None:
            aside_said(out, RESULTS, on_note)
        folder = None if self.in_storage else out
        self.journal = Journal(folder, header, resume=resume and not self.in_storage, on_note=on_note)
        self._replay()

    def _replay(self) -> None:
        """Tell the searcher the generations of the file; a last one that the budget cut short goes on if it may."""
        spent, whole = 0, True
        for trials in list(self.journal.generations):
            asked = self.search.ask()
            if not whole or [each.values for each in trials] != asked[: len(trials)]:
                raise ConfigError(
                    f"{self.journal.path}: the study was written by another version of the sampler: begin a new one"
                )
            whole = len(trials) == len(asked)
            if whole:
                self.search.tell(trials)
            elif self._affordable(asked, self.settings.budget - spent) > len(trials):
                self.journal.drop_last()
                self._pending = asked
            spent += sum(each.drives for each in trials)

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

    def save(self, tuned: Tuned, origin: str) -> None:
        """Write the machine of a result, if the search has a folder."""
        if self.out is not None:
            save(tuned, self.out / MACHINE, origin)

    @property
    def trials(self) -> list[Trial]:
        """All candidates so far."""
        if self.in_storage and self.shared is not None:
            return self.shared.trials
        return [each for generation in self.journal.generations for each in generation]

    @property
    def drives(self) -> int:
        """Number of drives so far; in a storage also those that are under way."""
        if self.in_storage and self.shared is not None:
            return self.shared.claimed()
        return sum(each.drives for each in self.trials)

    @property
    def is_spent(self) -> bool:
        """Whether the budget does not allow another candidate."""
        return self._race_drives(1) > self.settings.budget - self.drives

    def _race_drives(self, candidates: int) -> int:
        return self.racing.drives(candidates, self.task.courses, len(self.task.scenarios))

    def _needed(self, asked: Sequence[Values]) -> list[int]:
        """Number of drives that each candidate adds to the race of those before it."""
        needed, driving = [], 0
        for values in asked:
            drives = allowed(self.machine, self.parameters, values)
            needed.append(self._race_drives(driving + 1) - self._race_drives(driving) if drives else 0)
            driving += drives
        return needed

    def _affordable(self, asked: Sequence[Values], left: int) -> int:
        """Number of candidates, from the first one on, whose race needs no more drives than are left."""
        return sum(total <= left for total in itertools.accumulate(self._needed(asked)))

    def generation(self, evaluator: Evaluator) -> list[Trial]:
        """Ask, drive, tell; the last generation has as many candidates as the budget allows."""
        whole = self._pending or self.search.ask()
        self._pending = None
        if self.in_storage and self.shared is not None:
            count = self.shared.claim(self._needed(whole), self.settings.budget)
        else:
            count = self._affordable(whole, self.settings.budget - self.drives)
        asked = whole[:count]
        fitting = [values for values in asked if allowed(self.machine, self.parameters, values)]
        if not fitting:
            if asked:
                apply(self.machine, self.parameters, asked[0])  # it raises an error that tells the fault
            return []
        machines = [apply(self.machine, self.parameters, values) for values in fitting]
        scored = evaluator.race(machines, self.task.courses, self.objective, self.racing)
        results, worst = iter(scored), max(each.cost for each in scored)
        trials = [
            _trial(values, next(results)) if values in fitting else self._refused(values, worst) for values in asked
        ]
        if len(asked) == len(whole) or self.in_storage:
            self.search.tell(trials)
        self.journal.add(trials)
        return trials

    def _refused(self, values: Values, worst: float) -> Trial:
        """Trial of a candidate that the definition does not allow; it costs as much as the worst, and as a failure."""
        weights, nothing = self.objective.weights, (1.0, 1.0, 0.0, 0.0, 0.0)
        cost = max(worst, weights.failure + weights.unfinished)
        return Trial(values=values, cost=cost, full=False, drives=0, successes=0, parts=nothing, simulated_s=0.0)


def _trial(values: Values, scored: Scored) -> Trial:
    return Trial(
        values=values,
        cost=scored.cost,
        full=scored.full,
        drives=len(scored.drives),
        successes=sum(drive.success for drive in scored.drives),
        parts=tuple(np.mean([parts(drive) for drive in scored.drives], axis=0).tolist()),
        simulated_s=round(sum(drive.time_s for drive in scored.drives), 4),
    )


def tune(
    machine: MachineDefinition | str | Path,
    params: Sequence[str],
    task: Task,
    *,
    objective: Objective | None = None,
    settings: Settings | None = None,
    tie: bool = False,
    processes: Workers | None = None,
    out: Path | None = None,
    is_held: bool = False,
    resume: bool = False,
    storage: str | None = None,
    origin: str = "tral_fsm.tuning.tune",
    on_progress: Callable[[Progress], None] | None = None,
    on_stage: OnStage | None = None,
    on_note: OnNote = lambda said: None,
) -> Tuned:
    """Search parameters of a machine, as `tral tune` does.

    Args:
        machine: a definition, the name of a packaged machine, or a file.
        params: patterns of parameters, see `parameters.find`.
        task: courses, cars and sensors of the drives.
        objective: cost of drives, and their pooling.
        settings: settings of the search.
        tie: give all parameters of one pattern the same value.
        processes: number of processes, or address of a Dask scheduler; None: a process for each core. The result does
            not depend on it.
        out: folder of study.jsonl and machine.json, both up to date after each generation; None: no files. The machine
            is the one as it was until a better one is found. Results of an earlier search move to a folder before-N.
        is_held: whether the caller holds `out` by `folder.held`, to write more into it after the search.
        resume: go on with the study in `out`.
        storage: database URL or journal file that other processes may use too.
        origin: command line, for the description of the machine.
        on_progress: called after each generation.
        on_stage: called whenever drives have ended, with their stage.
        on_note: called with what the user should know: files that were set aside, a study that was mended.

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
    check_budget(task, settings)
    parameters = find(definition, params, tie=tie)
    with held(None if is_held else out):
        study = Study(
            definition, parameters, task, objective, settings, out=out, resume=resume, storage=storage, on_note=on_note
        )
        return _tuned(study, processes or os.cpu_count() or 1, origin, on_progress, on_stage)


def _tuned(
    study: Study,
    processes: Workers,
    origin: str,
    on_progress: Callable[[Progress], None] | None,
    on_stage: OnStage | None,
) -> Tuned:
    """Search, finals and held-out check."""
    began = time.perf_counter()
    with Evaluator(study.task, processes=processes, on_stage=on_stage) as evaluator:
        tuned = _search(study, evaluator, origin, on_progress)
        _finals(study, tuned, evaluator)
        study.save(tuned, origin)
    if study.settings.report_seeds:
        _hold_out(study, tuned, processes, on_stage)
    tuned.complete, tuned.seconds = True, time.perf_counter() - began
    study.save(tuned, origin)
    return tuned


def check_apart(task: Task, settings: Settings) -> None:
    """Refuse seeds of the held-out check that the search or its finals use.

    Raises:
        ConfigError: there are such seeds.
    """
    both = {*task.seeds, *final_seeds(task, settings)} & {*settings.report_seeds}
    if both:
        raise ConfigError(f"seeds {stretches(both)} are for tuning and for the report: choose other --report-seeds")


def check_budget(task: Task, settings: Settings) -> None:
    """Refuse a budget that is too small for a single candidate.

    Raises:
        ConfigError: it is.
    """
    needed = len(task.courses)
    if settings.budget < needed:
        raise ConfigError(
            f"budget = {settings.budget}: each candidate drives {needed} courses: expected {needed} or more, or fewer "
            "seeds"
        )


def final_seeds(task: Task, settings: Settings) -> tuple[int, ...]:
    """Seeds of the finals, which follow those of the search."""
    after = max(task.seeds) + 1
    count = 2 * len(task.seeds) if settings.final_seeds is None else settings.final_seeds
    return tuple(range(after, after + count))


def _search(study: Study, evaluator: Evaluator, origin: str, on_progress: Callable[[Progress], None] | None) -> Tuned:
    """Generations until the budget is spent."""
    evaluator.stage(StageName.AS_IT_WAS, len(study.task.courses))
    (old,) = evaluator.race([study.machine], study.task.courses, study.objective, Racing(keep=1.0))
    tuned = _found(study, _trial((), old), study.trials)
    study.save(tuned, origin)
    while True:
        _tell(study, tuned, on_progress)
        if study.is_spent:
            return tuned
        evaluator.stage(StageName.SEARCH, study.settings.budget, study.drives)
        if not study.generation(evaluator):  # other processes have taken what was left
            return tuned
        tuned = _found(study, tuned.old_trial, study.trials)
        study.save(tuned, origin)


def _tell(study: Study, tuned: Tuned, on_progress: Callable[[Progress], None] | None) -> None:
    """Tell the progress once a candidate has driven all courses."""
    best, budget = best_of(tuned.trials), study.settings.budget
    if on_progress is not None and best is not None:
        drives = sum(each.drives for each in tuned.trials)
        count = len(study.journal.generations)
        on_progress(Progress(generation=count, drives=drives, budget=budget, best=best, old=tuned.old_trial))


def _found(study: Study, old_trial: Trial, trials: list[Trial]) -> Tuned:
    """The result so far: the best candidate if it costs less than the old machine, else the old machine."""
    best = best_of(trials)
    values = best.values if best is not None and best.cost < old_trial.cost else None
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
    evaluator.stage(StageName.FINALS, len(machines) * len(courses))
    costs = [study.objective.cost(drives) for drives in evaluator.on_courses(machines, courses)]
    tuned.finals = list(zip(values, costs, strict=True))
    tuned.values, _ = min(tuned.finals, key=lambda each: each[1])
    tuned.new = machines[values.index(tuned.values)]


def _hold_out(study: Study, tuned: Tuned, processes: Workers, on_stage: OnStage | None) -> None:
    """Let the old and the new machine drive the courses of the held-out check, up to the time limit."""
    task = replace(study.task, seeds=study.settings.report_seeds, stuck_s=None)
    with Evaluator(task, processes=processes, on_stage=on_stage) as evaluator:
        evaluator.stage(StageName.CHECK, 2 * len(task.courses))
        tuned.old_drives, tuned.new_drives = evaluator.on_courses([tuned.old, tuned.new], task.courses)
    tuned.comparison = compare(tuned.old_drives, tuned.new_drives, study.objective)
