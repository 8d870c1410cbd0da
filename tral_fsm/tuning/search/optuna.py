"""Optuna's samplers: choices and whole numbers, several objectives, and studies that any number of processes share."""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Sequence
from typing import Any

from tral_env.errors import ConfigError, MissingExtraError, nearest
from tral_fsm.tuning.journal import refuse_another
from tral_fsm.tuning.objective import PARTS, Weights
from tral_fsm.tuning.parameters import Parameter, Value
from tral_fsm.tuning.search.space import Trial, Values, default_population, trial
from tral_fsm.tuning.search.storage import open_storage, reachable

SAMPLERS = ("tpe", "nsga2", "random")
OBJECTIVES = ("clearance", "time", "steering")
"""Parts of the cost that may stand for themselves."""
LOST_AFTER_S = 1800.0
"""A process that has told nothing for so long is taken for dead, and its open trials are done by others."""
_STAYS = ". What was told to it stays; the same command goes on"


def imported() -> Any:
    """The package, quiet.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        import optuna
    except ImportError:
        raise MissingExtraError("optuna", "tune", "this sampler") from None
    optuna.logging.set_verbosity(logging.WARNING)
    return optuna


class OptunaSearch:
    """A study of Optuna, in memory or in a storage that others work on too."""

    def __init__(
        self,
        parameters: Sequence[Parameter],
        sampler: str,
        *,
        seed: int = 0,
        population: int | None = None,
        objectives: Sequence[str] = (),
        weights: Weights | None = None,
        storage: str | None = None,
        header: dict[str, Any] | None = None,
    ) -> None:
        """Begin a study, or join the one in the storage.

        Args:
            parameters: what is searched.
            sampler: of `SAMPLERS`.
            seed: of the sampler; in a storage each process adds a number of its own, or all would ask for the same.
            population: candidates in a generation.
            objectives: of `OBJECTIVES`; none: the cost alone.
            weights: what a failed drive adds to every objective.
            storage: URL of a database, or path of a journal file.
            header: what is asked for, which must be the same for all that work on it.

        Raises:
            ConfigError: unknown sampler, a storage that cannot be used, or another study in it.
            MissingExtraError: Optuna, or the driver of the database, is not installed.
        """
        optuna = imported()
        if sampler not in SAMPLERS:
            raise ConfigError(f"unknown sampler '{sampler}': {nearest(sampler, ('cmaes', *SAMPLERS))}")
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
                storage=None if storage is None else open_storage(storage),
                sampler=_sampler(
                    optuna, sampler, (seed + (int(self._worker[:6], 16) if storage else 0)) % 2**32, self.population
                ),
                directions=["minimize"] * max(len(self.objectives), 1),
                load_if_exists=True,
            )
            self._join(header or {})

    def _join(self, header: dict[str, Any]) -> None:
        """Make sure that all work on the same, and begin at the machine's own values."""
        there = self.study.user_attrs.get("header")
        if there:
            refuse_another("the study in the storage", there, header)
        if there is None:
            self.study.set_user_attr("header", header)
        if not self.study.get_trials(deepcopy=False):
            self.study.enqueue_trial({each.label: each.start for each in self.parameters})

    def ask(self) -> list[Values]:
        """The next generation, beginning with what dead processes left open."""
        with reachable(self._storage, _STAYS):
            if self._storage is not None:
                self._adopt()
            self._open = [self.study.ask(self._distributions) for _ in range(self.population)]
            for each in self._open:
                each.set_user_attr("worker", self._worker)
                each.set_user_attr("asked", time.time())
        return [tuple(each.params[parameter.label] for parameter in self.parameters) for each in self._open]

    def _adopt(self) -> None:
        """Give trials that were begun long ago, and never told, to the process that asks next."""
        import optuna

        for each in self.study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.RUNNING,)):
            if time.time() - each.user_attrs.get("asked", time.time()) > LOST_AFTER_S:
                try:
                    self.study.tell(each.number, state=optuna.trial.TrialState.FAIL)
                except (ValueError, RuntimeError):  # another process was quicker
                    continue
                self.study.enqueue_trial(each.params)

    def tell(self, trials: Sequence[Trial]) -> None:
        """What they cost; each is in the storage from then on."""
        from optuna.exceptions import UpdateFinishedTrialError

        with reachable(self._storage, _STAYS):
            for open_, done in zip(self._open, trials, strict=True):
                try:
                    open_.set_user_attr("record", done.record())
                    self.study.tell(open_, self.costs(done))
                except UpdateFinishedTrialError:  # so late that another process took it for lost
                    self._add(open_, done)

    def _add(self, open_: Any, done: Trial) -> None:
        """Keep what a trial cost that is closed already."""
        import optuna

        self.study.add_trial(
            optuna.trial.create_trial(
                params=open_.params,
                distributions=open_.distributions,
                values=self.costs(done),
                user_attrs={"record": done.record()},
            )
        )

    def costs(self, done: Trial) -> list[float]:
        """What the study minimizes: the cost, or the objectives, each with what failing costs."""
        if not self.objectives:
            return [done.cost]
        by_name = dict(zip(PARTS, done.parts, strict=True))
        failing = self.weights.failure * by_name["failure"] + self.weights.unfinished * by_name["unfinished"]
        return [getattr(self.weights, name) * by_name[name] + failing for name in self.objectives]

    @property
    def trials(self) -> list[Trial]:
        """All that were told, by whichever process."""
        import optuna

        with reachable(self._storage, _STAYS):
            done = self.study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.COMPLETE,))
        return [trial(each.user_attrs["record"]) for each in done]


def _sampler(optuna: Any, name: str, seed: int, population: int) -> Any:
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


def front(trials: Sequence[Trial], objectives: Sequence[str]) -> list[Trial]:
    """Trials of which no other is better in one of the objectives and not worse in any; failed drives disqualify.

    Args:
        trials: those that drove all courses count.
        objectives: of `OBJECTIVES`.
    """
    rows = [(each, _judged(each, objectives)) for each in trials if each.full]
    best = [
        (each, mine)
        for each, mine in rows
        if not any(all(a <= b for a, b in zip(other, mine, strict=True)) and other != mine for _, other in rows)
    ]
    unique: dict[tuple[Value, ...], Trial] = {each.values: each for each, _ in sorted(best, key=lambda row: row[1])}
    return list(unique.values())


def _judged(each: Trial, objectives: Sequence[str]) -> tuple[float, ...]:
    by_name = dict(zip(PARTS, each.parts, strict=True))
    failing = 100.0 * (by_name["failure"] + by_name["unfinished"])
    return tuple(by_name[name] + failing for name in objectives)
