"""The result of a search, and its machine file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from tral_env.atomic import write_bytes
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.episode import EpisodeResult
from tral_fsm.formats import by_suffix, write
from tral_fsm.tuning.holdout import Change, Comparison
from tral_fsm.tuning.parameters import Parameter
from tral_fsm.tuning.search.space import Trial, Values


@dataclass(kw_only=True)
class Tuned:
    """Result of a search."""

    old: MachineDefinition
    new: MachineDefinition
    parameters: list[Parameter]
    values: Values | None
    """Values of the parameters in `new`; None: no candidate beat the old machine."""
    old_trial: Trial
    trials: list[Trial]
    generations: list[int]
    """Number of trials of each generation."""
    front: list[Trial] = field(default_factory=list)
    objectives: tuple[str, ...] = ()
    """Objectives of the front."""
    finals: list[tuple[Values | None, float]] = field(default_factory=list)
    """Values and cost of each finalist; None for the values of the old machine."""
    old_drives: list[EpisodeResult] = field(default_factory=list)
    """Drives of the old machine on the held-out courses."""
    new_drives: list[EpisodeResult] = field(default_factory=list)
    """Drives of the new machine on the held-out courses."""
    comparison: Comparison | None = None
    complete: bool = False
    seconds: float = 0.0

    @property
    def verdict(self) -> str:
        """Verdict as a sentence."""
        nothing = ["Nothing better than the machine as it was has been found."] if self.values is None else []
        if self.comparison is None:
            return " ".join([*nothing, "There was no held-out check."])
        if nothing:
            return nothing[0]
        kept = "" if self.kept is self.new else " The machine as it was is kept."
        return self.comparison.verdict + kept

    @property
    def kept(self) -> MachineDefinition:
        """The new machine; the old one if the check found the new one worse, or if nothing better was found."""
        worse = self.comparison is not None and self.comparison.change is Change.WORSE
        return self.old if worse or self.values is None else self.new

    @property
    def drives(self) -> int:
        """Number of drives of the search."""
        return sum(each.drives for each in self.trials)

    @property
    def simulated_s(self) -> float | None:
        """Simulated time of the drives of the search, s; None: an older study did not keep it."""
        times = [each.simulated_s for each in self.trials if each.simulated_s is not None]
        return sum(times) if len(times) == len(self.trials) else None

    def record(self) -> dict[str, Any]:
        """As plain values."""
        best = best_of(self.trials)
        return {
            "complete": self.complete,
            "parameters": [each.record() for each in self.parameters],
            "values": None if self.values is None else list(self.values),
            "old": self.old_trial.record(),
            "best": None if best is None else best.record(),
            "trials": len(self.trials),
            "drives": self.drives,
            "simulated_s": None if self.simulated_s is None else round(self.simulated_s, 1),
            "seconds": round(self.seconds, 1),
            "front": [each.record() for each in self.front],
            "finals": [{"values": None if v is None else list(v), "cost": cost} for v, cost in self.finals],
            "verdict": self.verdict,
            "held_out": None if self.comparison is None else self.comparison.record(),
        }


def best_of(trials: Sequence[Trial]) -> Trial | None:
    """The trial with the lowest cost of those that drove all courses; None if there is none."""
    return min((each for each in trials if each.full), key=lambda each: each.cost, default=None)


def described(tuned: Tuned, origin: str) -> MachineDefinition:
    """The machine that is kept; the description of a new one tells the source of its values."""
    if tuned.values is None or tuned.kept is tuned.old:
        return tuned.old
    pairs = zip(tuned.parameters, tuned.values, strict=True)
    numbers = ", ".join(f"{each.label} = {value}" for each, value in pairs)
    state = "" if tuned.complete else ", not finished"
    note = f"Tuned by `{origin}` (tral-env {metadata.version('tral-env')}{state}): {numbers}."
    text = re.split(r"(?:^| )Tuned by `", tuned.old.description, maxsplit=1)[0]
    return tuned.new.model_copy(update={"description": f"{text} {note}".strip()})


def save(tuned: Tuned, path: Path, origin: str) -> None:
    """Write the machine that is kept at once, in the format of the suffix; a link stays a link.

    Raises:
        MachineError: no format has this suffix.
    """
    write_bytes(path, write(described(tuned, origin), by_suffix(path.suffix)).encode("utf-8"))
