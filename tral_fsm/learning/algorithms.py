"""The algorithms of `tral train`, by name; the module of one is imported when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from tral_fsm.learning.run import TrainingRun


class Algorithm(NamedTuple):
    """How a network learns."""

    settings: Callable[[tuple[str, ...], Path | None], Any]
    """Hyper-parameters for some families, out of the package's file and one of one's own."""
    train: Callable[[TrainingRun], None]
    """Trains until the run is over."""


def find(name: str) -> Algorithm:
    """An algorithm of `choices.ALGORITHMS`.

    Raises:
        MissingExtraError: a package that it needs is not installed.
    """
    if name == "teacher":
        from tral_fsm.learning import teacher

        return Algorithm(teacher.teacher_settings, teacher.train)
    from tral_fsm.learning import reinforcement

    return Algorithm(partial(reinforcement.reinforcement_settings, name), reinforcement.train)
