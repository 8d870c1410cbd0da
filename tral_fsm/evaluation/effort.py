"""What was spent to prepare an agent: the drives of a search, the decisions of a training, and what its author adds.

The common unit of both sides is the simulated time of all cars together. What no file tells is unknown.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError, nearest
from tral_env.learned import Network
from tral_env.policy_file import digest, is_policy_file, load_network
from tral_fsm.policies import trained

MACHINE, NUMBERS = "machine.json", "tune.json"
"""Files that a search writes into its folder: the machine, and the figures of the search."""
CURVE = "curve.json"
"""File that a training writes into its folder: its points, the last of which tells how long it went on."""
SUFFIX = ".effort.json"
"""A file NAME.effort.json beside a file NAME tells the effort of it."""
OF_FOLDER = "effort.json"
"""The same for a folder of a training."""
MAX_DEPTH = 4
"""A policy is followed back through so many trainings at most."""
EQUAL_WITHIN = 1.25
"""Budgets count as equal up to this factor. Source: choice; a training ends with a whole round of decisions."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Effort for one agent; None: unknown."""

    drives: int | None = None
    """Drives of a search, without its finals and its check."""
    decisions: int | None = None
    """Decisions of a training, of all cars together, without its validations."""
    simulated_h: float | None = None
    """Simulated time of these drives or decisions, h."""
    minutes: float | None = None
    """Time that they took, min."""
    tried: int | None = None
    """Number of settings or designs that were tried for it, this one included."""
    note: str = ""
    """What else its author says."""

    def __post_init__(self) -> None:
        """Check the values, which may come from a file.

        Raises:
            ConfigError: a value is no number of its kind.
        """
        for name in ("drives", "decisions", "tried", "simulated_h", "minutes"):
            value = getattr(self, name)
            kinds = (int, float) if name in ("simulated_h", "minutes") else (int,)
            if value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, kinds) or not math.isfinite(value) or value < 0:
                what = "a number" if float in kinds else "a whole number"
                raise ConfigError(f"{name} = {value!r}: expected {what}, 0 or more, or null")
        if not isinstance(self.note, str):
            raise ConfigError(f"note = {self.note!r}: expected a text")

    def record(self) -> dict[str, Any]:
        """The effort for JSON."""
        return asdict(self)


def of_file(path: Path) -> Effort:
    """Effort of a machine file or a Python file: what the search in its folder tells, and its effort file.

    Raises:
        ConfigError: a file that should tell the effort is damaged.
    """
    found = Effort()
    if path.name == MACHINE and (path.parent / NUMBERS).exists():
        found = _of_search(path.parent / NUMBERS)
    return _with_file(found, path.with_suffix(SUFFIX))


def of_policy(path: Path, network: Network, depth: int = 0) -> Effort:
    """Effort of a trained policy, a folder or the policy.json in it.

    A training goes on behind the network that it keeps. So its curve, where it lies there, tells more than the policy.
    One that went on from another policy has the effort of both.

    Args:
        path: the policy.
        network: its network.
        depth: number of trainings that went on from it.

    Raises:
        ConfigError: as `of_file`.
    """
    folder = path if path.is_dir() else path.parent
    found = _plus(_of_training(folder, network), _before(network, depth))
    return _with_file(replace(found, note=_borrowed(network)), folder / OF_FOLDER)


def _of_training(folder: Path, network: Network) -> Effort:
    """Effort of the training that made a policy."""
    told: Mapping[str, Any] = network.provenance
    if (folder / CURVE).exists():
        points = _read(folder / CURVE)
        told = points[-1] if isinstance(points, list) and points and isinstance(points[-1], Mapping) else told
    decisions, seconds = _number(told.get("steps")), _number(told.get("seconds"))
    rate = network.learner.decision_hz
    return Effort(
        decisions=None if decisions is None else round(decisions),
        simulated_h=None if decisions is None else round(decisions / rate / 3600.0, 3),
        minutes=None if seconds is None else round(seconds / 60.0, 2),
    )


def _before(network: Network, depth: int) -> Effort | None:
    """Effort of the policy from which a training went on; None: it went on from none."""
    request = network.provenance.get("request")
    start = request.get("start") if isinstance(request, Mapping) else None
    if not isinstance(start, str):
        return None
    path = Path(trained.path_of(start))
    told = network.provenance.get("start_sha256")
    if depth >= MAX_DEPTH or not is_policy_file(path) or digest(path) != told:
        return Effort()
    return of_policy(path, load_network(path), depth + 1)


def _plus(one: Effort, before: Effort | None) -> Effort:
    """Sum of two efforts; what is unknown of one is unknown of both."""
    if before is None:
        return one
    known = one.decisions is not None and before.decisions is not None
    return replace(
        one,
        decisions=(one.decisions or 0) + (before.decisions or 0) if known else None,
        simulated_h=_sum(one.simulated_h, before.simulated_h),
        minutes=_sum(one.minutes, before.minutes),
    )


def _sum(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else round(one + other, 3)


def _borrowed(network: Network) -> str:
    """What a network has from a machine, whose effort is not that of the training."""
    if network.correction is not None:
        return "corrects a machine, whose effort is not counted"
    teacher = network.provenance.get("teacher")
    return f"taught by {teacher[:40]}, whose effort is not counted" if isinstance(teacher, str) else ""


def _of_search(path: Path) -> Effort:
    """Effort that a search wrote into its figures."""
    told = _read(path)
    if not isinstance(told, Mapping):
        raise ConfigError(f"{path}: got no figures of a search: mend it, or remove it")
    drives, seconds, simulated_s = (_number(told.get(name)) for name in ("drives", "seconds", "simulated_s"))
    return Effort(
        drives=None if drives is None else round(drives),
        simulated_h=None if simulated_s is None else round(simulated_s / 3600.0, 3),
        minutes=None if seconds is None or told.get("resumed") else round(seconds / 60.0, 2),
    )


def _with_file(found: Effort, path: Path) -> Effort:
    """An effort with what a file tells in its place."""
    if not path.exists():
        return found
    told = _read(path)
    names = [one.name for one in fields(Effort)]
    if not isinstance(told, Mapping):
        raise ConfigError(f"{path}: expected an object with some of {', '.join(names)}")
    for name in told:
        if name not in names:
            raise ConfigError(f"{path}: unknown entry '{name}': {nearest(name, names)}")
    try:
        return replace(found, **told)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: tells no effort ({error}): mend it, or remove it") from None


def _number(value: Any) -> float | None:
    """A finite number of 0 or more; else None."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) and value >= 0 else None


def verdict(contenders: Sequence[tuple[str, Iterable[Effort]]]) -> str:
    """Whether contenders were prepared with equal budgets, as a sentence; empty for fewer than two.

    Args:
        contenders: name and efforts of the agents of each contender that somebody prepared.
    """
    if len(contenders) < 2:
        return ""
    hours: dict[str, float] = {}
    for name, efforts in contenders:
        known = [one.simulated_h for one in efforts]
        if known and all(one is not None for one in known):
            hours[name] = sum(one for one in known if one is not None) / len(known)
    unknown = [name for name, _ in contenders if name not in hours]
    if unknown:
        return f"Whether the budgets are equal is unknown: no file tells the simulated time of {', '.join(unknown)}."
    told = ", ".join(f"{name} {value:.3g} h" for name, value in hours.items())
    equal = max(hours.values()) <= EQUAL_WITHIN * min(hours.values())
    return f"The budgets are {'equal' if equal else 'not equal'}, in simulated time of each agent: {told}."
