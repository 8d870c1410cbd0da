"""The docstring of the real car's environment is its page: its tables say what the code says."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import pytest
from pages import table

from tral_env.hardware.env import OUTPUTS, SENSORS, TralCarEnv
from tral_env.interface import action_space

PAGE = inspect.getdoc(TralCarEnv) or ""
SECTIONS = (
    "Description", "Action Space", "Observation Space", "Rewards", "Starting State", "Episode End", "Info", "Arguments",
    "Version History",
)  # fmt: skip


def test_it_has_the_sections_of_gymnasiums_pages() -> None:
    assert tuple(line.removeprefix("## ") for line in PAGE.splitlines() if line.startswith("## ")) == SECTIONS


def test_its_arguments_are_those_of_the_environment_with_their_defaults() -> None:
    def shown(default: Any) -> str:
        return f"{default.__module__}.{default.__name__}" if callable(default) else repr(default)

    parameters = inspect.signature(TralCarEnv).parameters.values()
    assert [(row[0], row[1]) for row in table(PAGE, "| argument |")] == [
        (f"`{each.name}`", f"`{shown(each.default)}`") for each in parameters
    ]


@pytest.mark.parametrize(("argument", "names"), [("output", OUTPUTS), ("sensors", SENSORS)])
def test_it_tells_the_names_that_an_argument_takes(argument: str, names: tuple[str, ...]) -> None:
    told = {row[0].strip("`"): row[2] for row in table(PAGE, "| argument |")}[argument]
    assert all(f'`"{name}"`' in told for name in names)


def test_its_actions_are_those_of_the_action_space() -> None:
    space = action_space()
    rows = table(PAGE, "| # | action |")
    assert [row[1] for row in rows] == ["`steering`", "`throttle`"]
    assert [(row[2], row[3]) for row in rows] == [
        (f"{low:g}", f"{high:g}") for low, high in zip(space.low, space.high, strict=True)
    ]


def test_its_keys_of_info_come_at_every_reset_and_step() -> None:
    env = TralCarEnv(clock=lambda: 0.0, sleep=lambda seconds: None)
    *told, warnings, armed_again_after = (row[0].strip("`") for row in table(PAGE, "| key |"))
    assert warnings == "warnings", "of steps with a fault that is only told"
    assert armed_again_after == "armed_again_after", "of a reset alone, after the actuator's process stopped the car"
    _, info = env.reset(seed=0)
    assert list(info) == told
    *_, info = env.step(np.zeros(2, np.float32))
    assert list(info) == told
    env.close()


def test_it_says_its_rate_as_a_whole_number_as_the_simulated_one_does() -> None:
    rate = TralCarEnv.metadata["render_fps"]
    assert (rate, type(rate)) == (80, int)
