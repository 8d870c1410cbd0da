"""Contenders by their texts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from courses import TWO_WALLS, blind

from tral_env.errors import ConfigError, TralError
from tral_env.learned import Network
from tral_env.learner import LearnerConfig, LearnerView
from tral_env.policy_file import save
from tral_fsm import load_machine
from tral_fsm.evaluation.batch import BatchRunner
from tral_fsm.evaluation.contenders import (
    Contender,
    contender,
    contenders,
    object_agent,
    row_policies,
    single_policy,
)
from tral_fsm.evaluation.effort import Effort
from tral_fsm.evaluation.episode import EpisodeRequest
from tral_fsm.formats import write
from tral_fsm.runtime.policy import MachinePolicy


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    path = tmp_path / "mine.json"
    path.write_text(write(TWO_WALLS, "json"))
    return path


def test_each_kind_is_known_by_its_text(mine: Path, tmp_path: Path) -> None:
    python = tmp_path / "own.py"
    python.write_text("class Still:\n    def act(self, observation):\n        return 0.0, 0.0\n")
    found = contenders(f"office, {mine}, {python}:Still, pursuit")
    assert [(one.name, one.agents[0].kind) for one in found] == [
        ("office", "machine"),
        ("mine", "machine"),
        ("Still", "python"),
        ("pursuit", "built-in"),
    ]
    assert [one.agents[0].sees_truth for one in found] == [False, False, False, True]


def test_ramp_is_the_manoeuvre_of_2016() -> None:
    assert contender("ramp").agents[0].digest == contender("gate").agents[0].digest


def test_a_name_can_be_given(mine: Path) -> None:
    assert contender(f"best={mine}").name == "best"


def test_training_seeds_of_one_agent_are_one_contender(mine: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    other.write_text(write(blind(), "json"))
    one = contender(f"ppo={mine}+{other}")
    assert (one.name, [agent.source for agent in one.agents]) == ("ppo", [str(mine), str(other)])
    assert one.record()["agents"][1]["digest"] == one.agents[1].digest


def test_an_agent_does_not_count_twice(mine: Path) -> None:
    with pytest.raises(ConfigError, match="two agents are the same"):
        contender(f"ppo={mine}+{mine}")


def test_the_digest_follows_the_content(mine: Path) -> None:
    before = contender(str(mine)).agents[0].digest
    mine.write_text(write(blind(), "json"))
    assert contender(str(mine)).agents[0].digest != before


def test_a_machine_of_a_run_is_called_like_its_folder(tmp_path: Path) -> None:
    (tmp_path / "ppo0").mkdir()
    (tmp_path / "ppo0" / "machine.json").write_text(write(blind(), "json"))
    assert contender(str(tmp_path / "ppo0" / "machine.json")).name == "ppo0"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (" , ", "got no policy: expected names or files"),
        ("wall,wall", "two are called 'wall': name one of them"),
    ],
)
def test_a_field_that_is_none_is_refused(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        contenders(text)


@pytest.mark.parametrize(("name", "nearest"), [("offise", "office"), ("pursit", "pursuit"), ("ram", "ramp")])
def test_an_unknown_policy_is_refused_with_the_nearest_name(name: str, nearest: str) -> None:
    with pytest.raises(TralError, match=f"did you mean '{nearest}'"):
        contenders(name)


def trained(folder: Path, seed: int, learner: LearnerConfig | None = None) -> Path:
    """A policy file whose network has random weights."""
    learner = learner or LearnerConfig()
    weights = np.random.default_rng(seed).normal(size=(2, LearnerView(learner, 1).size)).astype(np.float32)
    layers = [(weights, np.zeros(2, np.float32))]
    return save(Network(learner=learner, layers=layers, provenance={"algorithm": "ppo", "seed": seed}), folder)


def test_policy_files_are_agents_with_their_provenance(tmp_path: Path) -> None:
    first, second = trained(tmp_path / "ppo0", 0), trained(tmp_path / "ppo1", 1)
    assert contender(str(first)).name == contender(str(first.parent)).name == "ppo0"
    one = contender(f"ppo={first}+{second.parent}")
    assert [agent.kind for agent in one.agents] == ["policy file"] * 2
    assert [agent.provenance["seed"] for agent in one.agents] == [0, 1]
    assert one.agents[0].digest == contender(str(first.parent)).agents[0].digest != one.agents[1].digest


def test_a_policy_file_drives_in_a_batch_as_alone(tmp_path: Path) -> None:
    agent = contender(str(trained(tmp_path / "ppo0", 0))).agents[0]
    requests = [EpisodeRequest(0, "straight", seed) for seed in (1, 2, 3)]
    found = [
        BatchRunner(["straight"], rows=rows, randomization="none").drive_with(
            lambda world: row_policies(agent, world), requests
        )
        for rows in (1, 2)
    ]
    assert [one.outcome for one in found[0]] == [one.outcome for one in found[1]]
    assert [one.time_s for one in found[0]] == pytest.approx([one.time_s for one in found[1]])


class Steady:
    def reset(self, n: int = 1) -> None:
        pass

    def reset_rows(self, rows: Any) -> None:
        pass

    def act(self, observation: Any) -> Any:
        return np.tile([0.9, 0.5], (len(observation), 1))


def test_an_object_drives_in_many_rows() -> None:
    agent = object_agent("mine", Steady(), digest="1", seed=3)
    assert agent.record() == {
        "source": "mine", "kind": "object", "digest": "1", "sees_truth": False, "provenance": {"seed": 3},
        "effort": Effort().record(), "decision_hz": 80.0,
    }  # fmt: skip
    runner = BatchRunner(["straight"], rows=1, randomization="none")
    got = runner.drive_with(
        lambda world: row_policies(agent, world), [EpisodeRequest(0, "straight", seed) for seed in (1, 2)]
    )
    assert [one.outcome for one in got] == ["collision", "collision"]


def test_the_digest_of_python_covers_the_files_beside_it_that_it_imports(tmp_path: Path) -> None:
    """Also what one of them imports in a function, and no file that none imports."""
    own = "import near\nclass Still:\n    def act(self, observation):\n        return near.go()\n"
    (tmp_path / "own.py").write_text(own)
    (tmp_path / "near.py").write_text("def go():\n    from far import STEER\n    return STEER, 0.0\n")
    (tmp_path / "far.py").write_text("STEER = 0.1\n")
    (tmp_path / "other.py").write_text("1\n")

    def found() -> str:
        return contender(f"{tmp_path / 'own.py'}:Still").agents[0].digest

    first = found()
    (tmp_path / "other.py").write_text("2\n")
    assert found() == first
    (tmp_path / "far.py").write_text("STEER = 0.2\n")
    assert found() != first


@pytest.mark.parametrize("kind", ["machine", "policy file", "python"])
def test_a_source_that_changes_meanwhile_does_not_drive(kind: str, tmp_path: Path) -> None:
    def write_source(version: int) -> str:
        if kind == "policy file":
            return str(trained(tmp_path / "ppo", version))
        if kind == "python":
            text = f"class Own:\n    def act(self, observation):\n        return 0.{version}, 0.0\n"
            (tmp_path / "own_changes.py").write_text(text)
            return f"{tmp_path / 'own_changes.py'}:Own"
        (tmp_path / "m.json").write_text(write(blind(0.1 * version), "json"))
        return str(tmp_path / "m.json")

    agent = contender(write_source(1)).agents[0]
    assert agent.kind == kind
    assert single_policy(agent, "straight") is not None
    write_source(2)
    with pytest.raises(ConfigError, match="has changed since the comparison began"):
        single_policy(agent, "straight")
    runner = BatchRunner(["straight"], rows=1, randomization="none")
    with pytest.raises(ConfigError, match="has changed since the comparison began"):
        runner.drive_with(lambda world: row_policies(agent, world), [EpisodeRequest(0, "straight", 1)])


def test_agents_tell_what_was_spent_on_them(mine: Path, tmp_path: Path) -> None:
    mine.with_name("mine.effort.json").write_text('{"tried": 3}')
    found = contenders(f"office,specialists,{mine},{trained(tmp_path / 'ppo0', 0)},constant")
    assert [one.agents[0].effort for one in found] == [Effort(), Effort(), Effort(tried=3), Effort(), None]


def test_agents_tell_how_often_they_decide(tmp_path: Path) -> None:
    found = contenders(f"office,random,{trained(tmp_path / 'ppo0', 0, LearnerConfig(decision_hz=20))}")
    assert [one.agents[0].decision_hz for one in found] == [80.0, 10.0, 20.0]


def test_built_in_agents_are_told_apart_by_their_names() -> None:
    assert [agent.source for agent in contender("floors=constant+random").agents] == ["constant", "random"]
    with pytest.raises(ConfigError, match="two agents are the same"):
        contender("floors=constant+constant")


@pytest.mark.parametrize("entry", ["a=", "a=office+", "a=+office", "a= + "])
def test_an_empty_source_is_refused(entry: str) -> None:
    with pytest.raises(ConfigError, match="a source is empty: expected NAME=SOURCE"):
        contender(entry)


def test_a_contender_that_records_or_tables_cannot_hold_is_refused() -> None:
    with pytest.raises(ConfigError, match="two agents are called 'seed 0'"):
        Contender(name="ppo", agents=(object_agent("seed 0", Steady(), "1"), object_agent("seed 0", Steady(), "2")))
    with pytest.raises(ConfigError, match=r"without \|"):
        contender("a|b=office")
    with pytest.raises(ConfigError, match="got no agent"):
        Contender(name="none", agents=())


def test_the_specialists_drive_each_family_with_its_machine_in_a_batch_and_alone() -> None:
    agent = contender("specialists").agents[0]
    requests = [EpisodeRequest(0, "straight", 1), EpisodeRequest(0, "lane_change", 1)]
    runner = BatchRunner(["straight", "lane_change"], rows=1, randomization="none")
    together = runner.drive_with(lambda world: row_policies(agent, world), requests)
    alone = [
        runner.drive([load_machine(name)], [replace(request, machine=0)])[0]
        for name, request in zip(("wall", "lane_change"), requests, strict=True)
    ]
    assert together == alone
    for family, name in (("straight", "wall"), ("office", "office")):
        policy = single_policy(agent, family)
        assert isinstance(policy, MachinePolicy)
        assert policy.definition == load_machine(name)


@pytest.mark.parametrize("name", ["a\nb", " ", "\ud800"])
def test_a_name_that_no_table_can_hold_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="expected a name in one line"):
        Contender(name=name, agents=contender("constant").agents)
