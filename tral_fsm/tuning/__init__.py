"""Tuning: a search for parameters of a machine over thousands of drives, and a check on courses new to the search."""

from tral_fsm.tuning.evaluator import Evaluator, Racing, Stage, Task
from tral_fsm.tuning.found import Tuned, save
from tral_fsm.tuning.objective import Objective, Weights
from tral_fsm.tuning.parameters import apply, find
from tral_fsm.tuning.study import Progress, Settings, check_apart, tune

__all__ = [
    "Evaluator",
    "Objective",
    "Progress",
    "Racing",
    "Settings",
    "Stage",
    "Task",
    "Tuned",
    "Weights",
    "apply",
    "check_apart",
    "find",
    "save",
    "tune",
]
