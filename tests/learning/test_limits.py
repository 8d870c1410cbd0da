"""A correction that loses drives is tried with smaller limits of the speed before the training ends."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

pytest.importorskip("stable_baselines3")

from tral_env.policy_file import load_network
from tral_fsm.cli import app
from tral_fsm.learning.run import TrainingRun
from tral_fsm.learning.validation import Score

SMALL = {"cars": 3, "layers": [8], "algorithm": {"n_steps": 8, "batch_size": 24, "n_epochs": 1}, "correct_speed": 0.8}


def found(successes: int, time_s: float) -> Score:
    return Score(episodes=10, successes=successes, progress=successes / 10, time_s=time_s)


MACHINE = found(9, 30.0)
"""What the machine alone does."""


def train(out: Path, monkeypatch: pytest.MonkeyPatch, scores: list[Score]) -> list[dict[str, Any]]:
    """A training of a residual whose validations find these scores; its curve."""
    left = iter(scores)

    class Found:
        def __init__(self, *_: object, **__: object) -> None:
            """Drive nothing."""

        def score(self, policy: object) -> Score:
            return next(left)

        def close(self) -> None:
            """Nothing to free."""

    monkeypatch.setattr("tral_fsm.learning.run.Validation", Found)
    monkeypatch.setattr(TrainingRun, "is_validation_due", False)
    settings = out.with_suffix(".yaml")
    settings.write_text(yaml.safe_dump(SMALL))
    options = ["--algo", "residual", "--scenario", "straight", "--steps", "60", "--settings", str(settings)]
    done = CliRunner().invoke(app, ["train", *options, "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert next(left, None) is None
    points: list[dict[str, Any]] = json.loads((out / "curve.json").read_text())
    return points


def test_the_largest_limit_that_loses_no_drive_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = train(tmp_path / "run", monkeypatch, [MACHINE, found(7, 18.0), found(9, 22.0)])
    assert [point.get("correct_speed") for point in points] == [None, None, pytest.approx(0.56)]
    kept = load_network(tmp_path / "run")
    assert kept.correction is not None
    assert kept.correction.speed == pytest.approx(0.7 * 0.8)
    assert kept.provenance["settings"]["correct_speed"] == 0.8


def test_a_network_that_loses_no_drive_is_not_driven_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = train(tmp_path / "run", monkeypatch, [MACHINE, found(9, 25.0)])
    kept = load_network(tmp_path / "run")
    assert len(points) == 2
    assert kept.correction is not None
    assert kept.correction.speed == 0.8


def test_the_machine_alone_is_kept_if_all_limits_lose_drives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lost = [found(successes, 18.0) for successes in (6, 7, 8)]
    points = train(tmp_path / "run", monkeypatch, [MACHINE, *lost])
    assert [point["validation"]["successes"] for point in points] == [9, 6, 7, 8]
    assert load_network(tmp_path / "run").provenance["steps"] == 0
