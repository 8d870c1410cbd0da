"""Hyper-parameters of a network that learns from a machine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from tral_env.checks import is_number
from tral_env.errors import ConfigError
from tral_env.learner import LearnerConfig
from tral_fsm.learning.choices import check_size, positive, read_settings, sees_detections
from tral_fsm.learning.networks import ACTIVATIONS


@dataclass(frozen=True, kw_only=True)
class TeacherSettings:
    """Hyper-parameters; their meaning stands in settings/teacher.yaml."""

    learner: LearnerConfig
    cars: int
    layers: tuple[int, ...]
    activation: str
    learning_rate: float
    batch: int
    samples: int
    round_decisions: int
    round_updates: int
    teacher_rounds: int
    guarded: float
    help_above: float
    help_decisions: int
    average: float
    huber: float
    steering_weight: float
    chart: bool
    state_weight: float
    state_decisions: int
    stuck_s: float

    def __post_init__(self) -> None:
        check_size(self.cars, self.layers)
        if self.activation not in ACTIVATIONS:
            raise ConfigError(f"activation = {self.activation!r}: expected one of {', '.join(ACTIVATIONS)}")
        positive(self, "learning_rate", "batch", "samples", "round_decisions", "round_updates", "huber")
        positive(self, "steering_weight", "state_weight", "state_decisions", "stuck_s", "teacher_rounds")
        positive(self, "average", below=1.0)
        positive(self, "help_above", "help_decisions")
        if not is_number(self.guarded) or not 0.0 <= self.guarded <= 1.0:
            raise ConfigError(f"guarded = {self.guarded!r}: expected 0 to 1")


def teacher_settings(scenarios: tuple[str, ...], path: Path | None = None, *, plain: bool = False) -> TeacherSettings:
    """The hyper-parameters for some families, see `read_settings`.

    Args:
        scenarios: the families.
        path: a YAML file with some of the names; None: none.
        plain: whether the student sees the readings alone.

    Raises:
        ConfigError: see `read_settings`; or the file asks for a chart although the student is plain.
    """
    settings = read_settings(TeacherSettings, "teacher", path, "teacher_plain" if plain else None)
    if plain and settings.chart:
        raise ConfigError(f"{path}: chart = True with --plain, which means a student without one: give one of them")
    return replace(settings, learner=sees_detections(settings.learner, scenarios))
