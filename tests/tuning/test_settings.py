"""Settings of a search: what is none is refused before the search, not after it."""

import math
from typing import Any

import numpy as np
import pytest

from tral_env.errors import ConfigError
from tral_fsm.tuning import Settings, Task, tune

TASK = Task(scenarios=("straight",), seeds=(0, 1))


@pytest.mark.parametrize(
    ("kind", "values", "told"),
    [
        (Settings, {"budget": True}, "budget = True: expected a whole number"),
        (Settings, {"report_seeds": 5}, "report_seeds = 5: expected whole numbers, 0 or more, in a tuple"),
        (Settings, {"report_seeds": (-1,)}, r"report_seeds = \(-1,\)"),
        (Settings, {"racing": None}, "racing = None: expected a Racing"),
        (Task, {"seeds": (0, True)}, r"seeds = \(0, True\)"),
        (Task, {"stuck_s": math.nan}, "stuck_s = nan: expected a finite number of s"),
        (Task, {"stuck_s": 0.0}, "stuck_s = 0.0: expected a time above 0 s, or None"),
        (Task, {"camera": "foo"}, "unknown camera 'foo'"),
    ],
)
def test_settings_that_are_none_are_refused_before_the_search(kind: Any, values: dict[str, Any], told: str) -> None:
    needed = {"scenarios": ("straight",), "seeds": (0,)} if kind is Task else {}
    with pytest.raises(ConfigError, match=told):
        kind(**{**needed, **values})


def test_whole_numbers_of_numpy_are_settings() -> None:
    assert type(Settings(budget=np.int64(5)).budget) is int


def test_a_text_for_a_list_of_parameters_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"parameters = 'speed': expected a list of patterns, such as \['speed'\]"):
        tune("wall", "speed", TASK)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"objectives": ("clearance", "time")}, "several need the sampler nsga2"),
        ({"objectives": ("clearance",), "sampler": "nsga2"}, "expected two or more"),
        ({"objectives": ("clarity", "time"), "sampler": "nsga2"}, "unknown objective 'clarity'"),
        ({"budget": 0}, "budget = 0: expected a whole number, 1 or more"),
        ({"sampler": "cma"}, "unknown sampler 'cma': did you mean 'cmaes'"),
        ({"population": 2}, "population = 2: expected a whole number, 4 or more"),
        ({"population": 4.5}, "population = 4.5: expected a whole number"),
        ({"budget": None}, "budget = None: expected a whole number"),
        ({"seed": -1}, "seed = -1: expected a whole number"),
        ({"sampler": "nsga2", "objectives": ("time", "time")}, "two or more different ones"),
    ],
)
def test_settings_that_make_no_sense_are_refused(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Settings(**changed)  # type: ignore[arg-type]
