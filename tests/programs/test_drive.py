"""A set of episodes without a terminal."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest

from tral_env.errors import ConfigError
from tral_fsm.evaluation.episode import Tick
from tral_fsm.programs.drive import SUMMARY, DriveArguments, run

ARGUMENTS = DriveArguments(
    scenario="straight", seed=3, episodes=2, policy="wall", camera="projected", randomization="none", course=None,
    video=False,
)  # fmt: skip


@pytest.fixture
def course(tmp_path: Path) -> str:
    path = tmp_path / "short.json"
    path.write_text(json.dumps({"name": "short", "segments": [{"length": 3.0}]}))
    return str(path)


def test_each_episode_is_shown_and_kept(tmp_path: Path, course: str) -> None:
    shown: list[str] = []
    ticks: list[Tick] = []

    def progress(name: str) -> nullcontext:
        shown.append(name)
        return nullcontext(ticks.append)

    out = tmp_path / "out"
    report = run(replace(ARGUMENTS, course=course), out, progress)
    assert shown == ["short, seed 3", "short, seed 4"]
    assert report == json.loads((out / SUMMARY).read_text())
    assert report["complete"]
    assert [episode["seed"] for episode in report["episodes"]] == [3, 4]
    assert [tick.index for tick in ticks].count(0) == 2


def test_a_scenario_that_is_none_makes_no_folder(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="did you mean 'straight'"):
        run(replace(ARGUMENTS, scenario="strait"), tmp_path / "out", lambda name: nullcontext(print))
    assert list(tmp_path.iterdir()) == []
