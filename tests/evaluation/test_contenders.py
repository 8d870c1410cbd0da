"""Contenders by their texts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from courses import TWO_WALLS, blind

from tral_env.errors import ConfigError, TralError
from tral_fsm.evaluation import contenders as contenders_module
from tral_fsm.evaluation.batch import BatchRunner
from tral_fsm.evaluation.contenders import contender, contenders, object_agent, row_policies, starts_rows
from tral_fsm.evaluation.episode import EpisodeRequest
from tral_fsm.formats import write


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


def test_an_unknown_policy_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(TralError, match="did you mean 'office'"):
        contenders("offise")


class Network:
    """A policy of a file: it acts on many rows, and tells how it was made."""

    def __init__(self, **provenance: Any) -> None:
        self.provenance = provenance

    def reset(self, n: int = 1) -> None:
        pass

    def act(self, observation: Any) -> Any:
        return np.tile([0.9, 0.5], (len(observation), 1))


class RestartingNetwork(Network):
    def reset_rows(self, rows: Any) -> None:
        pass


def test_a_policy_file_is_one_agent_with_its_provenance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(contenders_module, "load_policy", lambda path: Network(algorithm="PPO", seed=3))
    folder = tmp_path / "ppo3"
    folder.mkdir()
    (folder / "policy.json").write_text("{}")
    (folder / "weights.safetensors").write_bytes(b"1")
    one = contender(str(folder / "policy.json"))
    assert (one.name, one.agents[0].kind) == ("ppo3", "policy file")
    assert one.record()["agents"][0]["provenance"] == {"algorithm": "PPO", "seed": 3}
    (folder / "weights.safetensors").write_bytes(b"2")
    assert contender(str(folder / "policy.json")).agents[0].digest != one.agents[0].digest


@pytest.mark.parametrize(("network", "starts"), [(Network, False), (RestartingNetwork, True)])
def test_a_policy_file_that_cannot_start_a_row_is_known(
    network: type, starts: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert starts_rows(contender("wall").agents[0])
    monkeypatch.setattr(contenders_module, "load_policy", lambda path: network())
    (tmp_path / "policy.json").write_text("{}")
    assert starts_rows(contender(str(tmp_path / "policy.json")).agents[0]) is starts


def test_an_object_drives_in_many_rows() -> None:
    agent = object_agent("mine", RestartingNetwork(), digest="1", seed=3)
    assert agent.record() == {
        "source": "mine", "kind": "object", "digest": "1", "sees_truth": False, "provenance": {"seed": 3}
    }  # fmt: skip
    runner = BatchRunner(["straight"], rows=1, randomization="none")
    got = runner.drive_with(
        lambda world: row_policies(agent, world), [EpisodeRequest(0, "straight", seed) for seed in (1, 2)]
    )
    assert [one.outcome for one in got] == ["collision", "collision"]
