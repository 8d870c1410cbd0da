"""`tral live --car` is another door to `tral deploy --view`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tral_fsm.cli import app, deploy
from tral_fsm.programs.deploy import DeployArguments


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> list[tuple[DeployArguments, Path]]:
    """What `tral deploy` would have driven."""
    found: list[tuple[DeployArguments, Path]] = []

    def drive(arguments: DeployArguments, out: Path, *_: Any) -> None:
        found.append((arguments, out))

    monkeypatch.setattr(deploy, "drive", drive)
    return found


def test_both_doors_drive_the_same(driven: list[tuple[DeployArguments, Path]]) -> None:
    for command in ("live --car car.toml --policy wall", "deploy --view --policy wall --config car.toml"):
        assert CliRunner().invoke(app, command.split()).exit_code == 0
    assert driven[0] == driven[1]
    assert not driven[0][0].arm


@pytest.mark.parametrize("option", ["--seed 3", "--scenario gates", "--beside office", "--replay a.mcap", "--twin one"])
def test_what_a_real_car_does_not_have_is_refused(option: str, driven: list[tuple[DeployArguments, Path]]) -> None:
    done = CliRunner().invoke(app, ["live", "--car", "car.toml", *option.split()])
    assert done.exit_code == 2
    assert driven == []


def test_the_view_of_a_drive_that_cannot_listen_is_refused_before_the_car_is_opened(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["deploy", "--policy", "wall", "--arm", "--view", "--host", "192.0.2.1"])
    assert done.exit_code == 2
    assert "the page cannot listen on --host 192.0.2.1" in " ".join(done.stderr.split())
