"""What a training is asked for, and the hyper-parameters of its algorithm, which stand in a file each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import yaml

from tral_env.errors import ConfigError, nearest
from tral_env.learner import LearnerConfig
from tral_fsm.evaluation.choices import check_families
from tral_fsm.evaluation.suites import SPLITS

Settings = TypeVar("Settings")

ALGORITHMS = ("teacher", "ppo", "sac", "residual")
TRAINING_SEED = SPLITS["train"].start
"""Training begins at this seed and draws on from there."""
VALIDATION_SEEDS = SPLITS["validation"]
"""Courses on which the best network is chosen. Courses of 5000 and up are for tests and never seen here."""
WITHOUT_DETECTIONS = frozenset({"straight", "doors", "corners", "loop", "lane_change", "obstacles"})
"""Families without gates and turn signs."""


@dataclass(frozen=True, kw_only=True)
class TrainRequest:
    """What `tral train` is asked for."""

    algo: str
    scenarios: tuple[str, ...]
    minutes: float | None = None
    """Time for the training, min; None: `steps` limit it."""
    steps: int | None = None
    """Decisions of all cars together; None: `minutes` limit it."""
    seed: int = 0
    """Seed of the network and of the draws. Training with seed s begins at course `TRAINING_SEED` + 1000 s."""
    randomization: str = "default"
    machine: str | None = None
    """Teacher, or machine that is corrected; None: the packaged machine of the family."""
    validation: int = 50
    """Episodes of a validation, shared by the families."""
    nthread: int = 2
    """Threads that step the cars."""

    def __post_init__(self) -> None:
        if self.algo not in ALGORITHMS:
            raise ConfigError(f"unknown algorithm '{self.algo}': {nearest(self.algo, ALGORITHMS)}")
        check_families(self.scenarios)
        if (self.minutes is None) == (self.steps is None):
            raise ConfigError("got both --minutes and --steps, or none: expected one of them")
        for name, value in (("minutes", self.minutes), ("steps", self.steps)):
            if value is not None and not value > 0:
                raise ConfigError(f"--{name} {value}: expected more than 0")
        if not len(self.scenarios) <= self.validation <= len(VALIDATION_SEEDS) * len(self.scenarios):
            raise ConfigError(
                f"{self.validation} episodes of a validation: expected {len(self.scenarios)} to "
                f"{len(VALIDATION_SEEDS) * len(self.scenarios)}"
            )

    @property
    def scenario(self) -> str | tuple[str, ...]:
        """The families as the environments take them."""
        return self.scenarios[0] if len(self.scenarios) == 1 else self.scenarios

    @property
    def first_seed(self) -> int:
        """Seed of the first course of the training."""
        return TRAINING_SEED + 1000 * self.seed

    @property
    def machine_name(self) -> str:
        """The machine that teaches or is corrected."""
        if self.machine is not None:
            return self.machine
        return MACHINES[self.scenarios[0]] if len(self.scenarios) == 1 else "office"

    def record(self) -> dict[str, Any]:
        """The request, for JSON."""
        return asdict(self) | {"scenarios": list(self.scenarios)}


MACHINES = {
    "straight": "wall",
    "doors": "doors",
    "corners": "corners",
    "loop": "loop",
    "lane_change": "lane_change",
    "obstacles": "obstacles",
    "gates": "gate",
    "crossing": "crossing",
    "office": "office",
}
"""Family -> packaged machine that drives it."""


def settings_text(algo: str) -> str:
    """The packaged file of hyper-parameters of an algorithm."""
    return (resources.files("tral_fsm.learning") / "settings" / f"{algo}.yaml").read_text(encoding="utf-8")


def read_settings(kind: type[Settings], algo: str, path: Path | None = None) -> Settings:
    """Hyper-parameters of an algorithm: those of the package, and over them those of a file.

    Args:
        kind: the dataclass of the algorithm.
        algo: name of the algorithm.
        path: a YAML file with some of the names; None: none.

    Raises:
        ConfigError: the file cannot be read, or has a name or a value that is not allowed.
    """
    values = yaml.safe_load(settings_text(algo))
    if path is not None:
        values |= _own(path)
    return settings_of(kind, values, str(path or f"{algo}.yaml"))


def _own(path: Path) -> dict[str, Any]:
    try:
        own = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    if not isinstance(own, dict):
        raise ConfigError(f"{path}: expected names and values, such as learning_rate: 0.001")
    return own


def settings_of(kind: type[Settings], values: Mapping[str, Any], source: str) -> Settings:
    """Settings of a mapping.

    Raises:
        ConfigError: a name is unknown or missing, or a value is of another kind.
    """
    places = {place.name: place for place in fields(kind)}  # type: ignore[arg-type]
    for name in values:
        if name not in places:
            raise ConfigError(f"{source}: unknown '{name}': {nearest(name, places)}")
    missing = [name for name in places if name not in values]
    if missing:
        raise ConfigError(f"{source}: {', '.join(missing)} missing")
    try:
        return kind(**{name: _value(name, value) for name, value in values.items()})
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{source}: {error}") from error


def _value(name: str, value: Any) -> Any:
    if name == "learner":
        if not isinstance(value, Mapping):
            raise ConfigError(f"learner = {value!r}: expected names and values of a LearnerConfig")
        return LearnerConfig.of(value)
    return tuple(value) if isinstance(value, list) else value


def positive(settings: Any, *names: str, below: float = float("inf")) -> None:
    """Refuse values that are not above 0.

    Raises:
        ConfigError: one is not.
    """
    for name in names:
        value = getattr(settings, name)
        if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value < below:
            raise ConfigError(
                f"{name} = {value!r}: expected a number above 0" + (f", below {below:g}" if below < 1e9 else "")
            )


def sees_detections(learner: LearnerConfig, scenarios: tuple[str, ...]) -> LearnerConfig:
    """The learner without gates and signs if none of the families has any."""
    from dataclasses import replace

    return replace(learner, detections=learner.detections and not set(scenarios) <= WITHOUT_DETECTIONS)
