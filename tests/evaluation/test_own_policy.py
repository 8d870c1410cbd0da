"""Policies that are no machines, as objects and from files."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lane import Cruiser, Lane

from tral_env.errors import ConfigError, PolicyError
from tral_fsm import MachinePolicy
from tral_fsm.evaluation.own_policy import OwnPolicy, as_policy, find_policy
from tral_fsm.evaluation.rollout import drive

FILE = """
import neighbour
from tral_fsm import load_policy


class Weaver:
    active_states = ["weaving"]

    def __init__(self):
        self.ticks = 0

    def act(self, observation):
        self.ticks += 1
        return [0.1, neighbour.THROTTLE]


class Fragile(Weaver):
    def act(self, observation):
        return [0.0, 1 / (2 - len(self.sofar()))]

    def sofar(self):
        self.ticks += 1
        return range(self.ticks)


class Needy(Weaver):
    def __init__(self, gain):
        super().__init__()


def make():
    return Weaver()


def machine():
    return load_policy("wall")


def broken():
    raise OSError("no network.zip")


ready = Weaver()
number = 3
"""


@pytest.fixture
def own(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "neighbour.py").write_text("THROTTLE = 0.25\n")
    (tmp_path / "own.py").write_text(FILE)
    path, modules = list(sys.path), set(sys.modules)
    yield tmp_path / "own.py"
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        del sys.modules[name]


class Predicts:
    """A recurrent network counts its calls in its state."""

    def __init__(self) -> None:
        self.seen: list[Any] = []

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> Any:
        self.seen.append((state, episode_start.tolist(), deterministic))
        return np.array([0.0, 0.5]), (state or 0) + 1


@pytest.mark.parametrize("name", ["Weaver", "make", "ready"])
def test_a_class_a_function_and_an_object_drive(own: Path, name: str) -> None:
    episode = drive(Lane(), find_policy(f"{own}:{name}"), seed=1)
    assert episode.trace.action.tolist() == [[np.float32(0.1), np.float32(0.25)]] * 10
    assert set(episode.trace.states) == {"weaving"}


def test_a_function_may_give_a_machine(own: Path) -> None:
    assert isinstance(find_policy(f"{own}:machine"), MachinePolicy)
    assert isinstance(find_policy("wall"), MachinePolicy)


@pytest.mark.parametrize(
    ("name", "error", "told"),
    [
        (":Weavr", ConfigError, r"own\.py has no 'Weavr': did you mean 'Weaver'\? Allowed: Weaver, "),
        ("", ConfigError, r"expected FILE\.py:NAME, such as .*own\.py:Weaver$"),
        (":", ConfigError, r"expected FILE\.py:NAME"),
        (":Needy", ConfigError, "it needs arguments: write a function without arguments that makes the policy"),
        (":number", ConfigError, r"got 3: expected an object with act\(observation\) or predict\(observation\), or a "),
        (":broken", PolicyError, r"cannot be made: OSError: no network\.zip \(own\.py, line \d+\)"),
    ],
)
def test_a_name_that_gives_no_policy_is_refused(own: Path, name: str, error: type[Exception], told: str) -> None:
    with pytest.raises(error, match=told):
        find_policy(f"{own}{name}")


def test_a_file_that_is_not_there_or_does_not_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.py: there is no such file"):
        find_policy(f"{tmp_path / 'none.py'}:P")
    for text, told in (
        ("x = 1\nprint(y)", r"NameError: name 'y' is not defined \(bad\.py, line 2\)"),
        ("def f(:", r"SyntaxError: .* \(bad\.py, line 1\)"),
        ("raise SystemExit(3)", r"SystemExit: 3 \(bad\.py, line 1\)"),
    ):
        (tmp_path / "bad.py").write_text(text)
        with pytest.raises(PolicyError, match=rf"bad\.py cannot be loaded: {told}$"):
            find_policy(f"{tmp_path / 'bad.py'}:P")


def test_an_error_while_driving_names_the_policy_the_time_and_the_line(own: Path) -> None:
    with pytest.raises(PolicyError) as caught:
        drive(Lane(), find_policy(f"{own}:Fragile"), seed=1)
    line = FILE.splitlines().index("        return [0.0, 1 / (2 - len(self.sofar()))]") + 1
    assert str(caught.value) == (
        f"policy {own}:Fragile failed at 0.03 s: ZeroDivisionError: division by zero (own.py, line {line})"
    )
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


@pytest.mark.parametrize("answer", [None, 0.5, [0.0, float("nan")], [[0.0, 0.1], [0.0, 0.1]], "left"])
def test_an_answer_that_is_no_command_is_refused(answer: Any) -> None:
    class Odd:
        def act(self, observation: Any) -> Any:
            return answer

    with pytest.raises(PolicyError, match=r"policy Odd answered .* at 0\.01 s: expected two finite numbers"):
        drive(Lane(), Odd(), seed=1)


def test_predict_gets_what_stable_baselines_gives_it() -> None:
    own = Predicts()
    policy = as_policy(own)
    drive(Lane(steps=2), policy, seed=1)
    drive(Lane(steps=1), policy, seed=1)
    assert own.seen == [(None, [True], True), (1, [False], True), (None, [True], True)]


def test_a_predict_of_the_observation_alone_is_enough() -> None:
    class Plain:
        def predict(self, observation: Any) -> Any:
            return 0.0, 0.5

    assert OwnPolicy(Plain()).act(np.zeros(20)).tolist() == [0.0, 0.5]


def test_a_reset_with_or_without_a_number_of_cars_is_called_at_each_episode() -> None:
    class Forgets:
        resets = 0

        def reset(self) -> None:
            self.resets += 1

        def act(self, observation: Any) -> Any:
            return [0.0, 0.1]

    own = Forgets()
    for _ in range(2):
        drive(Lane(steps=1), own, seed=1)
    assert own.resets == 2


class Tells(Predicts):
    """A policy that tells its clearance and its states."""

    def __init__(self, **told: Any) -> None:
        super().__init__()
        vars(self).update(told)


@pytest.mark.parametrize("wanted", [(1.0, 0.5), [[1.0, 0.5]], np.array([1.0, 0.5])])
def test_a_wanted_clearance_is_a_pair_or_a_row(wanted: Any) -> None:
    episode = drive(Lane(steps=2), Tells(wanted_clearance=wanted, active_states=("near",)), seed=1)
    assert episode.trace.wanted.tolist() == [[1.0, 0.5]] * 2
    assert episode.trace.states == ("near", "near")


@pytest.mark.parametrize(
    ("told", "error"),
    [
        ({"wanted_clearance": 0.5}, r"policy Tells: wanted_clearance = 0\.5: expected two numbers: \+1 for the left"),
        ({"wanted_clearance": ("left", 0.5)}, "expected two numbers"),
        ({"active_states": "follow"}, r"policy Tells: active_states = 'follow': expected a list"),
        ({"active_states": 3}, "expected a list"),
    ],
)
def test_what_a_policy_tells_in_another_form_is_refused(told: dict[str, Any], error: str) -> None:
    with pytest.raises(PolicyError, match=error):
        drive(Lane(steps=1), Tells(**told), seed=1)


def test_a_property_that_fails_is_worded() -> None:
    class Absent(Cruiser):
        @property
        def wanted_clearance(self) -> Any:
            return self.not_there  # type: ignore[attr-defined]

    with pytest.raises(PolicyError, match="policy Absent failed to tell its wanted_clearance: AttributeError"):
        drive(Lane(steps=1), Absent(), seed=1)


def test_what_cannot_drive_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"policy int: got 3: expected an object with act\(observation\)"):
        drive(Lane(), 3, seed=1)
    with pytest.raises(ConfigError, match=r"policy Predicts: got the class: expected an object: Predicts\(\)"):
        drive(Lane(), Predicts, seed=1)
    with pytest.raises(ConfigError, match="drives one car, got 2"):
        OwnPolicy(Predicts()).reset(2)


POLICY = "from {name} import STEER\nclass P:\n    def act(self, observation):\n        return STEER, 0.0\n"


@pytest.mark.parametrize("folders", [("a", "b"), ("a", "a/b"), ("a/b", "a")])
def test_files_of_two_folders_have_their_own_neighbours(own: Path, folders: tuple[str, str]) -> None:
    for k, folder in enumerate(folders, 1):
        place = own.parent / folder
        place.mkdir(parents=True, exist_ok=True)
        (place / "agent.py").write_text(POLICY.format(name="helpers.of"))
        (place / "helpers").mkdir()
        (place / "helpers" / "__init__.py").write_text("")
        (place / "helpers" / "of.py").write_text(f"STEER = 0.{k}\n")
    steers = [find_policy(f"{own.parent / folder / 'agent.py'}:P").act(np.zeros(3))[0] for folder in folders * 2]
    assert steers == pytest.approx([0.1, 0.2, 0.1, 0.2])
