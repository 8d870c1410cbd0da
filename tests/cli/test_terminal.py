"""Tables on a terminal of 80 columns: nothing is wider, and no name or figure is lost."""

import io

import numpy as np
import pytest
from courses import drive
from rich.console import Console
from rich.table import Table
from typer.testing import CliRunner

from tral_fsm.cli import app, doctor
from tral_fsm.cli.doctor import Finding
from tral_fsm.cli.show import table_of_episodes
from tral_fsm.cli.tune_show import check_table
from tral_fsm.tuning.holdout import compare
from tral_fsm.tuning.objective import Objective

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
