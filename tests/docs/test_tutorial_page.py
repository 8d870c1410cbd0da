"""docs/tutorial.md, followed word by word in an empty folder, gives what it says."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from pages import commands, examples, read

NAME = "docs/tutorial.md"
PAGE = read(NAME)

CHEAPER = ("range(10)", "range(4, 6)")
"""Two of the ten seeds: with seed 4 the limit saves the car, with seed 5 PD is enough."""
FEWER = ("--episodes 10", "--episodes 1")
"""One of the ten courses with corners: seed 0 has two to the left and two to the right."""


def run(folder: Path, command: str) -> subprocess.CompletedProcess[str]:
    program, *arguments = command.split()
    start = {"python": [], "tral": ["-c", "from tral_fsm.cli import app; app()"]}[program]
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run(
        [sys.executable, "-W", "error", *start, *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path, "COLUMNS": "120"},
        capture_output=True,
        text=True,
    )


def figures(folder: Path, name: str) -> dict[str, object]:
    """What summary.json says of the only drive of a folder."""
    (episode,) = json.loads((folder / "runs" / name / "summary.json").read_text())["episodes"]
    return episode


@pytest.mark.slow
def test_the_page_followed_word_by_word(tmp_path: Path) -> None:
    exit_codes, printed = {}, {}
    for example in examples(NAME, PAGE):
        if example.language in ("python", "json"):
            before = "\n".join(PAGE.splitlines()[: example.line - 1])
            file = re.findall(r"Save this(?: class)? as `([\w.]+)`", before)[-1]
            assert not (tmp_path / file).exists()
            (tmp_path / file).write_text(example.text.replace(*CHEAPER))
        for command in commands(example) if example.language == "bash" else ():
            done = run(tmp_path, command.replace(*FEWER))
            exit_codes[command.partition(" --out")[0]], printed[command] = done.returncode, done.stdout
            assert "Traceback" not in done.stderr, done.stderr
    assert [command for command, code in exit_codes.items() if code] == [
        "tral drive --policy stop.json --course one_box --seed 0 --no-video"
    ]
    assert re.findall(r"(\d+) of", printed["python ten.py"]) == ["0", "1", "2"]
    assert figures(tmp_path, "corners")["success"]
    assert figures(tmp_path, "wall")["clearance_rmse_m"] == pytest.approx(0.15, abs=0.01)
    assert figures(tmp_path, "other")["success"]
    (tmp_path / "wall.json").write_text((tmp_path / "wall.json").read_text().replace('"d": 0.0', '"d": 1.0'))
    again = next(command for command in printed if "wall.json --scenario" in command)
    assert run(tmp_path, again).returncode == 0
    assert figures(tmp_path, "wall")["clearance_rmse_m"] == pytest.approx(0.023, abs=0.002)
