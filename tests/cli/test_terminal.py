"""Tables on a terminal of 80 columns: nothing is wider, and no name or figure is lost."""

import io
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from courses import drive
from rich.console import Console
from rich.table import Table
from typer.testing import CliRunner

from tral_fsm.cli import app, doctor
from tral_fsm.cli.doctor import Finding
from tral_fsm.cli.show import table_of_episodes
from tral_fsm.cli.tune_show import Bar, check_table
from tral_fsm.tuning import Progress, Stage
from tral_fsm.tuning.evaluator import StageName
from tral_fsm.tuning.holdout import compare
from tral_fsm.tuning.objective import Objective
from tral_fsm.tuning.search.space import Trial

NARROW = {"COLUMNS": "80"}


def widest(text: str) -> int:
    return max(map(len, text.splitlines()))


def natural_width(table: Table) -> int:
    """Width of a table that has all the room it wants."""
    console = Console(width=1000, file=io.StringIO())
    return console.measure(table).maximum


@pytest.mark.parametrize(
    "command",
    [
        "fsm states",
        "fsm states FollowWall",
        "fsm states Any",
        "courses",
        "tune --list-params --policy office",
        "tune --list-params --policy lane_change",
        "drive --help",
        "tune --help",
    ],
)
def test_a_command_keeps_to_80_columns(command: str) -> None:
    shown = CliRunner().invoke(app, command.split(), env=NARROW)
    assert shown.exit_code == 0
    assert widest(shown.stdout) <= 80


def test_the_doctor_keeps_to_80_columns() -> None:
    shown = CliRunner().invoke(app, ["doctor"], env=NARROW)
    assert widest(shown.stdout) <= 80


def test_the_table_of_a_drive_keeps_to_80_columns_with_the_longest_figures() -> None:
    row = {
        "scenario": "lane_change", "seed": 12345, "outcome": "missed_gate", "crash": False, "success": False,
        "progress": 0.985, "time_s": 123.4, "mean_speed_mps": 0.66, "clearance_rmse_m": 0.123, "gates_passed": 12,
        "gates_total": 12,
    }  # fmt: skip
    figures = {
        "successes": 98, "episodes": 100, "progress": 1.0, "time_s": 101.2, "mean_speed_mps": 0.5,
        "clearance_rmse_m": 0.1, "gates_passed": 320, "gates_total": 330, "collisions": 3,
    }  # fmt: skip
    arguments = {"policy": "gate_scurve", "camera": "rendered"}
    table = table_of_episodes({"arguments": arguments, "episodes": [row, row], "figures": figures})
    assert natural_width(table) <= 80


def test_the_check_of_a_search_keeps_to_80_columns() -> None:
    random = np.random.default_rng(0)
    old, new = (
        [drive(seed=seed, clearance_rmse=scale * random.uniform(0.5, 1.5)) for seed in range(40)]
        for scale in (0.2, 0.3)
    )
    assert natural_width(check_table(compare(old, new, Objective()))) <= 80


def test_doctor_prints_a_remedy_whole_also_where_a_word_is_longer_than_its_column(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    remedy = "pip install 'stable-baselines3>=2.10,<3'"
    missing = Finding(topic="extra rl", name="stable-baselines3", ok=False, needed=False, detail="none", remedy=remedy)
    detail = "n9.0.2-17-g2a571b6068" * 3
    found = Finding(topic="core", name="opencv-python-headless", ok=True, needed=True, detail=detail)
    monkeypatch.setattr(doctor, "examine", lambda: [found, missing])
    shown = CliRunner().invoke(app, ["doctor"], env=NARROW).stdout
    assert widest(shown) <= 80
    assert "…" not in shown
    column = "".join(line.split("│")[4].strip() for line in shown.splitlines() if line.count("│") == 5)
    assert column.replace(" ", "") == remedy.replace(" ", "")


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252"])
@pytest.mark.parametrize("command", ["fsm states", "fsm states Turn", "courses", "fsm check {machine}"])
def test_a_console_of_another_encoding_shows_what_it_can(command: str, encoding: str, tmp_path: Path) -> None:
    machine = tmp_path / "machine.json"
    machine.write_text('{"root": "沿壁", "states": [{"id": "走", "type": "Stop"}]}', "utf-8")
    done = subprocess.run(
        [sys.executable, "-c", "from tral_fsm.cli import app; app()", *command.format(machine=machine).split()],
        env={**os.environ, "PYTHONIOENCODING": encoding, "COLUMNS": "80"},
        capture_output=True,
        check=False,
    )
    assert done.stderr == b""
    assert done.returncode == ("{machine}" in command)
    shown = done.stdout.decode("utf-8" if encoding == "ascii" else encoding)  # click takes ASCII for a mistake
    if command == "fsm states Turn":
        assert ">= 0, <= 5" in shown
    if "{machine}" in command and encoding != "ascii":
        assert "??" in shown


def test_the_bar_of_a_search_keeps_to_80_columns_and_its_times_are_whole(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    old, worse = (
        Trial(values=(1.0,), cost=cost, full=True, drives=8, successes=8, parts=(0.0,) * 5) for cost in (13.1, 13.2)
    )
    with Bar() as bar:
        for name in StageName:
            bar.stage(Stage(name=name, done=6000, total=6000))
        bar.best(Progress(generation=3, drives=6000, budget=6000, best=worse, old=old))
    shown = capfd.readouterr().err
    assert "search: none better than 13.100 yet" in shown
    assert shown.count("6000/6000 drives") == len(StageName)
    assert "…" not in shown
    assert widest(shown) <= 80


@pytest.mark.parametrize("command", [["live"], ["deploy"], ["fsm", "check"], ["twin", "up"]])
def test_the_lines_of_a_help_are_as_long_as_the_terminal_allows(command: list[str]) -> None:
    said = CliRunner().invoke(app, [*command, "--help"], env=NARROW).output
    words = [line.strip() for line in said.partition("╭")[0].splitlines()]
    for line, following in pairwise(words):
        if line and following:
            assert len(f" {line} {following.split()[0]} ") > 80 - 2
