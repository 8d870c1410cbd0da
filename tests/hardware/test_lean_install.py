"""What the requirements of the car leave out is not imported there, and they are those of the project."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
REQUIREMENTS = ROOT / "tral_env" / "hardware" / "requirements-car.txt"
HIDDEN = (
    "mujoco",
    "torch",
    "stable_baselines3",
    "matplotlib",
    "imageio",
    "av",
    "jinja2",
    "cmaes",
    "optuna",
    "PIL",
)
"""Distributions of the simulation, of learning, of tuning and of reports, as modules."""
HIDE = f"""
import importlib.abc, sys


class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {HIDDEN!r}:
            raise ModuleNotFoundError(f"No module named '{{name}}': hidden by a test")


sys.meta_path.insert(0, Hidden())
"""


def lean(program: str, folder: Path) -> str:
    """What a program prints that finds none of the hidden modules."""
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", HIDE + program], cwd=folder, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


def test_every_module_of_the_car_is_imported_and_a_policy_drives_it(tmp_path: Path) -> None:
    program = """
import importlib, pkgutil
import gymnasium, tral_env.hardware
from tral_env.interface import check_readings
from tral_fsm import load_policy

for module in pkgutil.walk_packages(tral_env.hardware.__path__, "tral_env.hardware."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
env = gymnasium.make("tral_env:TralCar-v0", output="recorder")
policy = load_policy("wall")
policy.reset()
observation, info = env.reset(seed=1)
for _ in range(8):
    observation, *_, info = env.step(policy.act(observation))
env.close()
print(info["tick"], len(env.unwrapped.output.sent))
"""
    tick, sent = map(int, lean(program, tmp_path).split())
    assert tick == 8
    assert sent >= 10


@pytest.mark.parametrize(
    ("command", "told"),
    [
        (["--help"], "car"),
        (["car", "init", "car.toml", "--board", "log"], "car.toml is written"),
        (["fsm", "check", "wall"], "wall"),
    ],
)
def test_the_commands_of_the_car_run(tmp_path: Path, command: list[str], told: str) -> None:
    program = f"""
from tral_fsm.cli import app
app({command!r})
"""
    assert told in lean(program, tmp_path)


def test_the_hidden_modules_are_hidden(tmp_path: Path) -> None:
    program = f"""
import importlib
for name in {HIDDEN!r}:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        print(name)
"""
    assert lean(program, tmp_path).split() == list(HIDDEN)


def test_each_requirement_is_one_of_the_project_with_its_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    known = {*project["dependencies"], *project["optional-dependencies"]["car"]}
    lines = [line for line in REQUIREMENTS.read_text().splitlines() if not line.startswith("#")]
    assert set(lines) <= known
    assert set(project["optional-dependencies"]["car"]) <= set(lines)
    assert not {re.split(r"\W", line)[0] for line in lines} & set(HIDDEN)


def test_a_policy_is_deployed_and_its_drive_recorded(tmp_path: Path) -> None:
    program = """
from tral_fsm.cli import app
app(["car", "init", "car.toml", "--board", "log"], standalone_mode=False)
app(["deploy", "--policy", "slow.py:Slow", "--dry", "--arm", "--seconds", "0.2", "--out", "out"])
"""
    (tmp_path / "slow.py").write_text("class Slow:\n    def act(self, observation):\n        return [0.0, 0.1]\n")
    assert "time limit" in lean(program, tmp_path)
    assert (tmp_path / "out" / "drive.mcap").stat().st_size > 1000
