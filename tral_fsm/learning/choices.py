"""What a training is asked for, and the hyper-parameters of its algorithm, which stand in a file each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import numpy as np
from pydantic import TypeAdapter, ValidationError

from tral_env import yaml_text
from tral_env.checks import is_number, one_of
from tral_env.errors import ConfigError, nearest
from tral_env.learned import MAX_LAYERS
from tral_env.learner import LearnerConfig
from tral_env.randomization import level
from tral_fsm.evaluation.choices import check_families
from tral_fsm.evaluation.suites import SPLITS
from tral_fsm.policies.families import machine_for

Settings = TypeVar("Settings")

ALGORITHMS = ("teacher", "ppo", "sac", "residual")
TRAINING_SEEDS = SPLITS["train"]
"""Courses of trainings."""
VALIDATION_SEEDS = SPLITS["validation"]
"""Courses on which the best network is chosen. Courses of 5000 and up are for tests and never seen here."""
MAX_UNITS = 1024
"""A layer of a network that is trained has so many units at most. Source: choice."""
MAX_CARS = 4096
"""A training drives so many cars at most."""
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
    """Seed of the network and of the draws."""
    randomization: str = "default"
    """Levels, separated by commas: every episode draws one, and a validation drives all."""
    machine: str | None = None
    """Teacher, or machine that is corrected; None: the packaged machine of the family."""
    validation: int = 50
    """Episodes of a validation, shared by the families."""
    start: str | None = None
    """Folder of a policy with whose network the training begins; None: with one that knows nothing."""
    plain: bool = False
    """A student that sees the readings alone, without estimate and state chart."""
    nthread: int = 2
    """Threads or processes that drive the cars; what they drive does not depend on it."""

    def __post_init__(self) -> None:
        one_of("algorithm", self.algo, ALGORITHMS)
        check_families(self.scenarios)
        if (self.minutes is None) == (self.steps is None):
            got = "neither --minutes nor" if self.minutes is None else "both --minutes and"
            raise ConfigError(f"got {got} --steps: expected one of them")
        if self.minutes is not None and not (is_number(self.minutes) and self.minutes > 0):
            raise ConfigError(f"--minutes {self.minutes!r}: expected a finite number above 0")
        for name, lowest in (("steps", 1), ("seed", 0), ("validation", 1), ("nthread", 1)):
            value = getattr(self, name)
            if name == "steps" and value is None:
                continue
            if type(value) is not int or value < lowest:
                raise ConfigError(f"--{name} {value!r}: expected a whole number, {lowest} or more")
        if self.start is not None and self.algo != "ppo":
            raise ConfigError(f"--from {self.start} with --algo {self.algo}: ppo alone goes on from a policy")
        if self.plain and self.algo != "teacher":
            raise ConfigError(f"--plain with --algo {self.algo}: its networks see the readings alone in any case")
        for each in self.levels:
            level(each)
        groups = len(self.scenarios) * len(self.levels)
        if not groups <= self.validation <= len(VALIDATION_SEEDS) * groups:
            raise ConfigError(f"--validation {self.validation}: expected {groups} to {len(VALIDATION_SEEDS) * groups}")

    @property
    def scenario(self) -> str | tuple[str, ...]:
        """The families as the environments take them."""
        return self.scenarios[0] if len(self.scenarios) == 1 else self.scenarios

    @property
    def levels(self) -> tuple[str, ...]:
        """The levels of randomization, one or several."""
        return tuple(self.randomization.split(","))

    @property
    def validation_seeds(self) -> range:
        """Seeds of the courses that a validation drives, of each family and on each level."""
        return VALIDATION_SEEDS[: -(-self.validation // (len(self.scenarios) * len(self.levels)))]

    def first_seed(self, begun: int = 0) -> int:
        """Seed of the first course; row i begins with this seed + i.

        Args:
            begun: how far an earlier training was that this one goes on with: it gets other courses.
        """
        drawn = int(np.random.SeedSequence((self.seed, begun)).generate_state(1)[0])
        return TRAINING_SEEDS.start + drawn % (len(TRAINING_SEEDS) - MAX_CARS)

    @property
    def machine_name(self) -> str:
        """The machine that teaches or is corrected."""
        if self.machine is not None:
            return self.machine
        return machine_for(self.scenarios)

    def record(self) -> dict[str, Any]:
        """The request, for JSON."""
        return asdict(self) | {"scenarios": list(self.scenarios)}


def settings_text(algo: str) -> str:
    """The packaged file of hyper-parameters of an algorithm."""
    return (resources.files("tral_fsm.learning") / "settings" / f"{algo}.yaml").read_text(encoding="utf-8")


def read_settings(kind: type[Settings], algo: str, path: Path | None = None, variant: str | None = None) -> Settings:
    """Hyper-parameters of an algorithm: those of the package, and over them those of a file.

    Args:
        kind: the dataclass of the algorithm.
        algo: name of the algorithm.
        path: a YAML file with some of the names; None: none.
        variant: a packaged file with some of the names, which come before those of `path`; None: none.

    Raises:
        ConfigError: the file cannot be read, or has a name or a value that is not allowed.
    """
    values = _mapping(settings_text(algo), f"{algo}.yaml")
    if variant is not None:
        _replace(values, _mapping(settings_text(variant), f"{variant}.yaml"))
    if path is not None:
        _replace(values, _own(path))
    return settings_of(kind, values, str(path or f"{algo}.yaml"))


def _replace(values: dict[str, Any], new: Mapping[str, Any]) -> None:
    """Put new values over others; of a mapping those that it names."""
    for name, value in new.items():
        old = values.get(name)
        values[name] = old | value if isinstance(old, dict) and isinstance(value, dict) else value


def _own(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from error
    return _mapping(text, str(path))


def _mapping(text: str, source: str) -> dict[str, Any]:
    found = yaml_text.documents(text, source, ConfigError)
    if len(found) != 1 or not isinstance(found[0], dict):
        raise ConfigError(f"{source}: expected names and values, such as learning_rate: 0.001")
    return dict(_plain(found[0]))


def _plain(value: Any) -> Any:
    """Values of YAML without their lines; 1e-3, which YAML 1.1 reads as text, is a number."""
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, list) else yaml_text.number(value)


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
    hints = get_type_hints(kind)
    try:
        return kind(**{name: _value(name, hints[name], value) for name, value in values.items()})
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{source}: {error}") from error


def _value(name: str, hint: Any, value: Any) -> Any:
    if hint is LearnerConfig:
        if not isinstance(value, Mapping):
            raise ConfigError(f"learner = {value!r}: expected names and values of a LearnerConfig")
        return LearnerConfig.of(value)
    try:
        return TypeAdapter(hint).validate_python(tuple(value) if isinstance(value, list) else value, strict=True)
    except ValidationError as error:
        problem = error.errors()[0]
        place = "".join(f"[{part}]" for part in problem["loc"])
        raise ConfigError(f"{name}{place} = {problem['input']!r}: {problem['msg']}") from error


def positive(settings: Any, *names: str, below: float = float("inf")) -> None:
    """Refuse values that are not above 0.

    Raises:
        ConfigError: one is not.
    """
    for name in names:
        value = getattr(settings, name)
        if not is_number(value) or not 0 < value < below:
            raise ConfigError(
                f"{name} = {value!r}: expected a number above 0" + (f", below {below:g}" if below < 1e9 else "")
            )


def check_size(cars: int, layers: tuple[int, ...]) -> None:
    """Refuse more cars than a training drives, and layers that a policy file cannot hold.

    Raises:
        ConfigError: there are too many, or a layer has no units.
    """
    if not 1 <= cars <= MAX_CARS:
        raise ConfigError(f"cars = {cars}: expected 1 to {MAX_CARS}")
    if len(layers) >= MAX_LAYERS or not all(1 <= units <= MAX_UNITS for units in layers):
        raise ConfigError(f"layers = {list(layers)}: expected at most {MAX_LAYERS - 1}, of 1 to {MAX_UNITS} units each")


def sees_detections(learner: LearnerConfig, scenarios: tuple[str, ...]) -> LearnerConfig:
    """The learner without gates and signs if none of the families has any."""
    return replace(learner, detections=learner.detections and not set(scenarios) <= WITHOUT_DETECTIONS)
