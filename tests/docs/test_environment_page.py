"""The docstring of the environment is its page: its tables say what the code says, and docs/environment.md holds it."""

from __future__ import annotations

import ast
import inspect
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from pages import read, table

from tral_env import options
from tral_env.config import CameraConfig, EscConfig, TaskConfig
from tral_env.env import TralCorridorEnv
from tral_env.interface import CORE_LAYOUT, OPTIONAL_GROUPS, action_space
from tral_env.learner import config as learner
from tral_env.randomization import LEVELS
from tral_env.task import REWARD_TERMS
from tral_env.vector_env import TralCorridorVectorEnv
from tral_env.world import RESET_OPTIONS

PAGE = inspect.getdoc(TralCorridorEnv) or ""
SECTIONS = (
    "Description", "Action Space", "Observation Space", "Rewards", "Starting State", "Episode End", "Info", "Arguments",
    "Reset Options", "Version History",
)  # fmt: skip


def names(header: str) -> list[str]:
    return [row[0].strip("`") for row in table(PAGE, header)]


def test_it_has_the_sections_of_gymnasiums_pages() -> None:
    found = [line.removeprefix("## ") for line in PAGE.splitlines() if line.startswith("## ")]
    assert tuple(found) == SECTIONS


def test_the_page_of_the_docs_holds_it() -> None:
    _, sections = PAGE.split("\n\n", 1)
    assert sections in read("docs/environment.md"), "paste the sections of inspect.getdoc(TralCorridorEnv)"


def test_its_arguments_are_those_of_the_environment_with_their_defaults() -> None:
    parameters = inspect.signature(TralCorridorEnv).parameters.values()
    shown = [(row[0], row[1]) for row in table(PAGE, "| argument |")]
    assert shown == [(f"`{each.name}`", f"`{each.default!r}`") for each in parameters]


def test_its_arguments_say_what_the_fields_of_the_configuration_say() -> None:
    shown = {row[0].strip("`"): row[2] for row in table(PAGE, "| argument |")}
    told = docstrings_of_options()
    assert {name: shown[name] for name in told} == told


def docstrings_of_options() -> dict[str, str]:
    """What `CorridorConfig` and `LearnerConfig` say below each field that is an option."""
    told = docstrings_of_fields(options, "CorridorConfig") | docstrings_of_fields(learner, "LearnerConfig")
    return {field.name: told[field.name] for field in options.option_fields()}


def docstrings_of_fields(module: ModuleType, name: str) -> dict[str, str]:
    tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
    body = next(node.body for node in tree.body if isinstance(node, ast.ClassDef) and node.name == name)
    return {
        ast.unparse(field.target): " ".join(ast.literal_eval(ast.unparse(below)).split())
        for field, below in pairwise(body)
        if isinstance(field, ast.AnnAssign)
    }


def test_its_actions_are_those_of_the_action_space() -> None:
    space = action_space()
    rows = table(PAGE, "| # | action |")
    assert [(row[2], row[3]) for row in rows] == [
        (f"{low:g}", f"{high:g}") for low, high in zip(space.low, space.high, strict=True)
    ]
    assert [row[1].strip("`") for row in rows] == ["steering", "throttle"]


def test_its_observation_is_that_of_the_interface() -> None:
    assert CORE_LAYOUT.table() in PAGE
    assert {row[0].strip("`"): int(row[1]) for row in table(PAGE, "| group |")} == {
        name: len(fields) for name, fields in OPTIONAL_GROUPS.items()
    }


def test_its_rewards_are_those_of_the_task_with_their_weights() -> None:
    assert names("| term |") == list(REWARD_TERMS)
    for row in table(PAGE, "| term |"):
        assert f"{getattr(TaskConfig(), row[1].strip('`')):g}" == row[2]


def test_its_time_limit_is_that_of_the_task() -> None:
    config = TaskConfig()
    assert f"`nominal_speed` ({config.nominal_speed:g} m/s) + `grace_s` ({config.grace_s:g} s)" in PAGE
    assert f"moves towards it at {config.touch_speed:g} m/s or more" in PAGE


def test_its_numbers_are_those_of_the_configuration() -> None:
    esc, cadences = EscConfig(), [LEVELS[name].sonar_cadence_s for name in LEVELS]
    assert f"up to a throttle of {esc.dead_zone:g}" in PAGE
    assert f"latency, {esc.nominal_latency_s:g} s\nwhen nothing is randomized" in PAGE
    assert f"has seen {esc.switch_s:g} s of brake and then {esc.switch_s:g} s of neutral" in " ".join(PAGE.split())
    slowest, fastest = 1 / max(high for _, high in cadences), 1 / min(low for low, _ in cadences)
    assert f"a sonar answers {slowest:.0f} to {fastest:.0f} times a second" in PAGE
    assert f"the camera {CameraConfig().rate_hz:g} times" in PAGE


def test_its_reset_options_are_those_of_the_world_and_of_the_vector_environment() -> None:
    assert names("| option |") == [*RESET_OPTIONS, "reset_mask"]


@pytest.fixture(scope="module")
def infos() -> list[dict[str, Any]]:
    """Info of a reset and of every step into the wall."""
    env = gym.make("tral_env:TralCorridor-v0", scenario="straight", randomization="none")
    told, ended = [env.reset(seed=0)[1]], False
    while not ended:
        *_, terminated, truncated, info = env.step(np.array([0.3, 1.0], np.float32))
        told.append(info)
        ended = terminated or truncated
    return told


def test_its_keys_of_info_come_when_it_says(infos: list[dict[str, Any]]) -> None:
    when = {row[0].strip("`"): row[2] for row in table(PAGE, "| key |")}

    def keys(*occasions: str) -> set[str]:
        return {name for name, occasion in when.items() if occasion in occasions}

    plain = keys("beside plain walls")
    first, *steps, last = [set(info) | plain for info in infos]
    assert first == keys("always", "reset") | plain
    assert all(step == keys("always", "steps") | plain for step in steps)
    assert last == keys("always", "steps", "last step") | plain
    assert any(plain <= set(info) for info in infos)


def test_the_vector_environment_takes_the_same_options() -> None:
    single, vector = (inspect.signature(env).parameters for env in (TralCorridorEnv, TralCorridorVectorEnv))
    names = [field.name for field in options.option_fields()]
    assert list(single)[-len(names) :] == list(vector)[-len(names) :] == names
    assert [single[name].default for name in names] == [vector[name].default for name in names]
