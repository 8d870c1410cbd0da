"""Tuning: numbers of a machine are searched, on thousands of drives, and checked on courses that are new to them."""

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
