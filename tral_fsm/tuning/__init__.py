"""Tuning: a search for parameters of a machine over thousands of drives, and a check on courses new to the search.

A name is imported when it is asked for, so that the data and tables of a search need no physics.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tral_fsm.tuning.evaluator import Evaluator, Racing, Stage, StageName, Task
    from tral_fsm.tuning.found import Tuned, save
    from tral_fsm.tuning.objective import Objective, Weights
    from tral_fsm.tuning.parameters import apply, find
    from tral_fsm.tuning.study import Progress, Settings, check_apart, check_budget, tune

_MODULES = {
    "evaluator": ("Evaluator", "Racing", "Stage", "StageName", "Task"),
    "found": ("Tuned", "save"),
    "objective": ("Objective", "Weights"),
    "parameters": ("apply", "find"),
    "study": ("Progress", "Settings", "check_apart", "check_budget", "tune"),
}
"""Module -> names in it."""

__all__ = [
    "Evaluator",
    "Objective",
    "Progress",
    "Racing",
    "Settings",
    "Stage",
    "StageName",
    "Task",
    "Tuned",
    "Weights",
    "apply",
    "check_apart",
    "check_budget",
    "find",
    "save",
    "tune",
]


def __getattr__(name: str) -> object:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
