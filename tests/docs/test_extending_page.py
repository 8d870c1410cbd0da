"""The distribution that docs/extending.md describes is found, checked and tested."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from pages import ROOT, examples, read, table

from tral_fsm import CarEstimate

PAGE = read("docs/extending.md")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The files of the page, and the metadata that pip makes of its pyproject.toml."""
    page = PAGE[PAGE.index("## A state and a condition") :]
    text = {
        name: [each.text for each in examples("", page) if each.language == name] for name in ("python", "toml", "json")
    }
    (tmp_path / "sine_wall.py").write_text(text["python"][0])
    (tmp_path / "test_sine_wall.py").write_text(text["python"][1])
    (tmp_path / "machine.json").write_text(text["json"][0])
    project = tomllib.loads(text["toml"][0])
    assert project["tool"]["setuptools"]["py-modules"] == ["sine_wall"]
    info = tmp_path / "sine_wall-0.1.dist-info"
    info.mkdir()
    name, version = project["project"]["name"], project["project"]["version"]
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    ((group, entries),) = project["project"]["entry-points"].items()
    lines = [f"{key} = {value}\n" for key, value in entries.items()]
    (info / "entry_points.txt").write_text(f"[{group}]\n{''.join(lines)}")
    return tmp_path


def run(folder: Path, *command: str) -> str:
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_its_machine_is_checked_with_the_types_of_the_plugin(folder: Path) -> None:
    assert "machine.json" in run(folder, "-c", "from tral_fsm.cli import app; app()", "fsm", "check", "machine.json")


def test_its_tests_pass(folder: Path) -> None:
    assert "2 passed" in run(folder, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_sine_wall.py")


def test_its_policy_is_driven_by_the_command_and_arrives(tmp_path: Path) -> None:
    (tmp_path / "middle.py").write_text(examples("", PAGE)[0].text)
    command = "tral drive --policy middle.py:Middle --course short --trace"
    assert command in PAGE
    drive = command.split()[1:]
    out = run(tmp_path, "-c", "from tral_fsm.cli import app; app()", *drive, "--no-video", "--out", "out")
    assert "yes" in out
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"summary.json", "trace.csv", "trajectory.png"}


def test_the_table_of_the_estimate_has_each_field_once() -> None:
    rows = table(PAGE, "| field | what it holds |")
    assert sorted(re.findall(r"`(\w+)`", " ".join(row[0] for row in rows))) == sorted(CarEstimate._fields)
    for name, value in CarEstimate()._asdict().items():
        (meaning,) = [row[1] for row in rows if f"`{name}`" in row[0]]
        if isinstance(value, tuple):
            assert [word for word in re.findall(r"`(\w+)`", meaning) if not hasattr(value, word)] == []


def test_the_tests_that_it_names_are_there() -> None:
    named = re.findall(r"\btests/[\w/]+(?:\.py)?", PAGE)
    assert len(named) > 10
    assert [name for name in named if not (ROOT / name).exists()] == []
