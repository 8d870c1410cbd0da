"""Samplers of Optuna: for choices, whole numbers and several objectives, and for studies that processes share."""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Callable, Sequence
from typing import Any

from tral_env.errors import MissingExtraError
from tral_fsm.tuning.choices import Sampler
from tral_fsm.tuning.journal import refuse_another
from tral_fsm.tuning.objective import PARTS, Weights
from tral_fsm.tuning.parameters import Parameter, Value
from tral_fsm.tuning.search.space import Trial, Values, default_population, trial
from tral_fsm.tuning.search.storage import open_storage, reachable

OBJECTIVES = ("clearance", "time", "steering")
"""Parts of the cost that may be objectives."""
LOST_AFTER_S = 1800.0
"""Time without a result after which a process counts as dead, and others do its open trials."""
_STAYS = ". What was told to it stays; the same command goes on"


def imported() -> Any:
    """The package, with its log silenced.

    Raises:
        MissingExtraError: the package is not installed.
    """
    try:
        import optuna
    except ImportError:
        raise MissingExtraError("optuna", "tune", "this sampler") from None
    optuna.logging.set_verbosity(logging.WARNING)
    return optuna


class OptunaSearch:
    """A study of Optuna, in memory or in a storage that other processes use too."""

    def __init__(
        self,
        parameters: Sequence[Parameter],
        sampler: Sampler,
        *,
        seed: int = 0,
        population: int | None = None,
        objectives: Sequence[str] = (),
        weights: Weights | None = None,
        storage: str | None = None,
        header: dict[str, Any] | None = None,
        on_note: Callable[[str], None] = lambda said: None,
    ) -> None:
        """Begin a study, or join the one in the storage.

        Args:
            parameters: the parameters.
            sampler: "tpe", "nsga2" or "random".
            seed: seed of the sampler; in a storage each process adds its own number, or all would ask for the same.
            population: number of candidates of a generation.
            objectives: some of `OBJECTIVES`; empty: the cost alone.
            weights: weights of a failed drive, which count in each objective.
            storage: database URL, or journal file.
            header: the search as plain values, the same for all processes of a study.
            on_note: called with what the user should know.

        Raises:
            ConfigError: the storage cannot be used, or it holds another study.
            MissingExtraError: Optuna, or the driver of the database, is not installed.
        """
        optuna = imported()
        self.parameters, self.objectives = list(parameters), tuple(objectives)
        self.population = population or default_population(len(self.parameters))
        self.weights = weights or Weights()
        self._worker = uuid.uuid4().hex
        self._storage = storage
        self._open: list[Any] = []
        self._distributions = {each.label: _distribution(optuna, each) for each in self.parameters}
        with reachable(storage):
            self.study = optuna.create_study(
                study_name="tral",
                storage=None if storage is None else open_storage(storage, on_note),
                sampler=_sampler(
                    optuna, sampler, (seed + (int(self._worker[:6], 16) if storage else 0)) % 2**32, self.population
                ),
                directions=["minimize"] * max(len(self.objectives), 1),
                load_if_exists=True,
            )
            self._join(header or {})

    def _join(self, header: dict[str, Any]) -> None:
        """Refuse the study of another search, and begin at the machine's own values."""
        there = self.study.user_attrs.get("header")
        if there:
            refuse_another("the study in the storage", there, header)
        if there is None:
            self.study.set_user_attr("header", header)
        if not self.study.get_trials(deepcopy=False):
            self.study.enqueue_trial({each.label: each.start for each in self.parameters})

    def ask(self) -> list[Values]:
        """The next generation; the open trials of dead processes come first."""
        with reachable(self._storage, _STAYS):
            if self._storage is not None:
                self._adopt()
            self._open = [self.study.ask(self._distributions) for _ in range(self.population)]
            for each in self._open:
                each.set_user_attr("worker", self._worker)
                each.set_user_attr("asked", time.time())
        return [tuple(each.params[parameter.label] for parameter in self.parameters) for each in self._open]

    def _adopt(self) -> None:
        """Put trials that dead processes left open into the queue."""
        import optuna

        for each in self.study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.RUNNING,)):
            if _is_lost(each):
                try:
                    self.study.tell(each.number, state=optuna.trial.TrialState.FAIL)
                except (ValueError, RuntimeError):  # another process was quicker
                    continue
                self.study.enqueue_trial(each.params)

    def claim(self, needed: Sequence[int], budget: int) -> int:
        """Claim drives of the budget for the candidates of the last `ask`, and give back those that find no room.

        A trial may drive if it fits beside all trials with a smaller number, driven or under way. So the processes
        together never exceed the budget, in whatever order they claim.

        Args:
            needed: drives that each candidate adds.
            budget: drives of all processes together.

        Returns:
            Number of candidates that may drive, from the first one on.
        """
        import optuna

        with reachable(self._storage, _STAYS):
            for open_, drives in zip(self._open, needed, strict=True):
                open_.set_user_attr("claim", drives)
            # A process that has asked and not yet claimed may claim this much.
            known = {each.number: _claim_of(each, max(needed)) for each in self._live()}
            numbers = [each.number for each in self._open]
            kept = 0
            for number in numbers:
                if sum(drives for other, drives in known.items() if other <= number) > budget:
                    break
                kept += 1
            for open_ in self._open[kept:]:
                self.study.tell(open_.number, state=optuna.trial.TrialState.FAIL)
            self._open = self._open[:kept]
        return kept

    def claimed(self) -> int:
        """Number of drives of all processes, driven or under way."""
        with reachable(self._storage, _STAYS):
            return sum(map(_claim_of, self._live()))

    def _live(self) -> list[Any]:
        """Trials that have been driven, or that a process may be driving."""
        from optuna.trial import TrialState

        trials = self.study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.RUNNING))
        return [each for each in trials if each.state == TrialState.COMPLETE or not _is_lost(each)]

    def tell(self, trials: Sequence[Trial]) -> None:
        """Take the costs of the last generation, and store each of them."""
        from optuna.exceptions import UpdateFinishedTrialError

        with reachable(self._storage, _STAYS):
            for open_, done in zip(self._open, trials, strict=True):
                try:
                    open_.set_user_attr("record", done.record())
                    self.study.tell(open_, self.costs(done))
                except UpdateFinishedTrialError:  # another process took the trial for lost
                    self._add(open_, done)

    def _add(self, open_: Any, done: Trial) -> None:
        """Add the cost of a trial that is closed already."""
        import optuna

        self.study.add_trial(
            optuna.trial.create_trial(
                params=open_.params,
                distributions=open_.distributions,
                values=self.costs(done),
                user_attrs={"record": done.record(), "claim": done.drives},
            )
        )

    def costs(self, done: Trial) -> list[float]:
        """Values that the study minimizes: the cost, or the objectives, each with the cost of failures."""
        if not self.objectives:
            return [done.cost]
        return list(objective_costs(done, self.objectives, self.weights))

    @property
    def trials(self) -> list[Trial]:
        """Trials of all processes whose cost is known."""
        import optuna

        with reachable(self._storage, _STAYS):
            done = self.study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.COMPLETE,))
        return [trial(each.user_attrs["record"]) for each in done]


def _is_lost(running: Any) -> bool:
    """Whether the process of a running trial counts as dead."""
    return bool(time.time() - running.user_attrs.get("asked", time.time()) > LOST_AFTER_S)


def _claim_of(trial_: Any, unsaid: int = 0) -> int:
    """Drives that a trial claims of the budget; `unsaid` before its process has said how many."""
    record = trial_.user_attrs.get("record", {})
    return int(trial_.user_attrs.get("claim", record.get("drives", unsaid)))


def _sampler(optuna: Any, name: Sampler, seed: int, population: int) -> Any:
    if name == "tpe":
        return optuna.samplers.TPESampler(seed=seed, n_startup_trials=population, constant_liar=True)
    if name == "nsga2":
        return optuna.samplers.NSGAIISampler(seed=seed, population_size=population)
    return optuna.samplers.RandomSampler(seed=seed)


def _distribution(optuna: Any, parameter: Parameter) -> Any:
    if parameter.kind == "choice":
        return optuna.distributions.CategoricalDistribution(parameter.choices)
    if parameter.kind == "int":
        return optuna.distributions.IntDistribution(round(parameter.low), round(parameter.high))
    return optuna.distributions.FloatDistribution(parameter.low, parameter.high, log=parameter.log)


def front(trials: Sequence[Trial], objectives: Sequence[str], weights: Weights | None = None) -> list[Trial]:
    """Pareto front: trials that no other trial dominates in `objective_costs`.

    Args:
        trials: the trials, of which those count that drove all courses.
        objectives: some of `OBJECTIVES`.
        weights: weights of the search.
    """
    weights = weights or Weights()
    rows = [(each, objective_costs(each, objectives, weights)) for each in trials if each.full]
    best = [
        (each, mine)
        for each, mine in rows
        if not any(all(a <= b for a, b in zip(other, mine, strict=True)) and other != mine for _, other in rows)
    ]
    unique: dict[tuple[Value, ...], Trial] = {each.values: each for each, _ in sorted(best, key=lambda row: row[1])}
    return list(unique.values())


def objective_costs(done: Trial, objectives: Sequence[str], weights: Weights) -> tuple[float, ...]:
    """Weighted part of each objective; the cost of failed drives is added to each."""
    by_name = dict(zip(PARTS, done.parts, strict=True))
    failing = weights.failure * by_name["failure"] + weights.unfinished * by_name["unfinished"]
    return tuple(getattr(weights, name) * by_name[name] + failing for name in objectives)
