"""The wheel holds all that a drive needs, and works where the checkout is not."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

DATA = (
    "assets/*.xml",
    "tral_env/course/*.json",
    "tral_env/course/examples/*.json",
    "tral_env/hardware/calibrations/*.json",
    "tral_env/hardware/systemd/*.service",
    "tral_env/ros/config/*.yaml",
    "tral_env/ros/launch/*.py",
    "tral_fsm/machines/*.json",
    "tral_fsm/machines/*.uxf",
    "tral_fsm/machines/palette/*.uxf",
    "tral_fsm/report/tuning/*.html.j2",
    "tral_fsm/trained/*/policy.*",
    "tral_*/py.typed",
)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder], cwd=ROOT, check=True)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def names(wheel: Path) -> Iterator[set[str]]:
    with zipfile.ZipFile(wheel) as archive:
        yield set(archive.namelist())


@pytest.mark.parametrize("pattern", DATA)
def test_data_of_the_checkout_is_in_the_wheel(pattern: str, names: set[str]) -> None:
    here = {path.relative_to(ROOT).as_posix() for path in ROOT.glob(pattern)}
    assert here
    assert {name.replace("assets/", "tral_env/assets/", 1) for name in here} <= names


def test_nothing_else_is_in_the_wheel(names: set[str]) -> None:
    assert {name.split("/")[0] for name in names} == {"tral_env", "tral_fsm", "tral_env-0.1.0.dist-info"}


def test_the_licence_is_in_the_wheel(names: set[str]) -> None:
    assert "tral_env-0.1.0.dist-info/licenses/LICENSE" in names


@pytest.mark.slow
def test_an_installed_wheel_drives(wheel: Path, tmp_path: Path) -> None:
    target = tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--target", target, wheel]
    subprocess.run(pip, check=True)
    program = """
import gymnasium as gym, tral_env, tral_fsm
from tral_env.assets import asset_path
print(tral_env.__file__, tral_fsm.__file__, asset_path("car.xml"), asset_path("corridor.xml"), sep="\\n")
env = gym.make("TralCorridor-v0", scenario="straight")
observation, _ = env.reset(seed=1)
policy = tral_fsm.load_policy("office")
assert env.observation_space.contains(env.step(policy.act(observation))[0])
gym.make("TralCar-v0").close()
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(target)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert all(Path(line).is_relative_to(target) for line in done.stdout.splitlines())
    assert len(done.stdout.splitlines()) == 4
