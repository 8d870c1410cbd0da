"""A level of randomization of one's own, as a file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import pytest

from tral_env.errors import ConfigError
from tral_env.randomization import LEVELS, Randomization, level


def written(tmp_path: Path, text: str, name: str = "level.yaml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def test_ranges_and_numbers_over_a_base(tmp_path: Path) -> None:
    path = written(tmp_path, "base: default  # the rest\nfriction: [0.4, 0.6]\nlatency_s: 0.02\n")
    assert level(path) == level(str(path)) == replace(LEVELS["default"], friction=(0.4, 0.6), latency_s=(0.02, 0.02))


def test_courses_are_hard_where_the_base_is_or_the_file_says_so(tmp_path: Path) -> None:
    assert level(written(tmp_path, "base: hard\nfriction: 0.5\n")).hard_courses
    assert not level(written(tmp_path, "base: hard\nhard_courses: false\n")).hard_courses
    assert level(written(tmp_path, "hard_courses: true\n")) == Randomization(hard_courses=True)
    with pytest.raises(ConfigError, match=r"hard_courses = 1\. Allowed: True, False"):
        level(written(tmp_path, "hard_courses: 1\n"))


def test_only_the_level_hard_has_hard_courses() -> None:
    assert [name for name, ranges in LEVELS.items() if ranges.hard_courses] == ["hard"]
    assert LEVELS["hard"].fixed(friction=0.5).hard_courses


def test_without_a_base_the_rest_is_the_nominal_car(tmp_path: Path) -> None:
    path = written(tmp_path, json.dumps({"friction": [0.4, 0.6]}), "level.JSON")
    assert level(path) == Randomization(friction=(0.4, 0.6))


def test_all_problems_are_told_at_once_with_their_names(tmp_path: Path) -> None:
    path = written(tmp_path, "base: defalt\nfrction: [1, 2]\nlatency_s: 20\nbattery_v:\nmass_scale: [2, 1]\n")
    with pytest.raises(ConfigError) as caught:
        level(path)
    head, *problems = str(caught.value).splitlines()
    assert head == f"{path}: 5 problems"
    for problem, told in zip(
        problems,
        (
            "base: got 'defalt': did you mean 'default'? Allowed: none, default, hard",
            "unknown parameter 'frction': did you mean 'friction'?",
            "latency_s = 20 s: expected 0 to 0.2 s; is it in ms or us?",
            "battery_v = None: expected a finite number of V",
            "mass_scale = [2, 1]: expected",
        ),
        strict=True,
    ):
        assert problem.strip().startswith(told)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("- 1\n- 2\n", "got list: expected parameters and their ranges"),
        ("", "got NoneType: expected parameters and their ranges"),
        ("friction: [0.4\n", r"level\.yaml:2:1: not YAML: .*: is a ',' or a '\]' missing\?"),
        (
            "friction: 1\nfriction: 2\n",
            r"level\.yaml:2:1: 'friction' stands twice, first in line 1: delete one of them",
        ),
        ("friction: 2024-13-41\n", "level.yaml: not readable: month must be in 1..12"),
        ("friction: 1\n---\nfriction: 2\n", "got 2 documents between lines of '---': expected one"),
    ],
)
def test_a_file_that_holds_no_level_is_refused(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        level(written(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("friction: 1\n", r"level\.json:1:1: not JSON: Expecting value"),
        ('{"friction": 0,5}', r"level\.json:1:16: not JSON: .*: a decimal comma\? JSON writes 0\.8"),
        ('{"friction": 1, "friction": 2}', "/friction: is there more than once. Allowed: each key once"),
        ("[" * 100_000, "level.json: not readable: "),
        ('{"friction": "0.5"}', "friction = '0.5': expected a finite number"),
    ],
)
def test_a_file_that_ends_in_json_is_read_as_json(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        level(written(tmp_path, text, "level.json"))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("level.json", '{\n\t"latency_s": [1e-05, 2E-2]\n}'),  # in YAML these are text, and the tab is an error
        ("level.yaml", "latency_s: [1e-05, 2E-2]\n"),
    ],
)
def test_a_number_without_a_point_is_a_number(tmp_path: Path, name: str, text: str) -> None:
    assert level(written(tmp_path, text, name)).latency_s == (1e-05, 0.02)


def test_a_file_that_is_not_there_and_an_unknown_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nope\.yaml: cannot be read: No such file"):
        level(tmp_path / "nope.yaml")
    with pytest.raises(ConfigError, match=r"did you mean 'hard'\? .*; a file has to end in \.json, \.yaml, \.yml"):
        level("hrd")


def test_an_environment_takes_the_file_and_its_spec_survives_json(tmp_path: Path) -> None:
    path = written(tmp_path, "friction: 0.55\n")
    env = gym.make("tral_env:TralCorridor-v0", course="short", randomization=str(path))
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    for one in (env, again):
        assert one.reset(seed=1)[1]["car"]["friction"] == 0.55
        one.close()
