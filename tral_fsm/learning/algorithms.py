"""The algorithms of `tral train`, by name; the module of one is imported when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from tral_fsm.learning.choices import TrainRequest
    from tral_fsm.learning.run import TrainingRun


class Algorithm(NamedTuple):
    """How a network learns."""

    settings: Callable[[TrainRequest, Path | None], Any]
    """Hyper-parameters for a request, out of the package's file and one of one's own."""
    train: Callable[[TrainingRun], None]
    """Trains until the run is over."""


def find(name: str) -> Algorithm:
    """An algorithm of `choices.ALGORITHMS`.

    Raises:
        MissingExtraError: a package that it needs is not installed.
    """
    if name == "teacher":
        from tral_fsm.learning import teacher
        from tral_fsm.learning.teacher_settings import teacher_settings

        return Algorithm(
            lambda request, path: teacher_settings(request.scenarios, path, plain=request.plain), teacher.train
        )
    from tral_fsm.learning import reinforcement

    return Algorithm(reinforcement.settings_for, reinforcement.train)
