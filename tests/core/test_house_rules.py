"""Who may import whom."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEAVY = {"mujoco", "torch", "stable_baselines3"}
WITHOUT_MUJOCO = (
    "tral_env/interface.py",
    "tral_env/errors.py",
    "tral_env/config.py",
    "tral_env/task.py",
    "tral_env/actuation.py",
    "tral_env/noise.py",
    "tral_env/randomization.py",
    "tral_env/sensors",
    "tral_env/hardware",
    "tral_env/course/layout.py",
    "tral_env/course/geometry.py",
    "tral_env/course/generate.py",
)


def files(place: str) -> list[Path]:
    path = ROOT / place
    return [path] if path.is_file() else sorted(path.rglob("*.py"))


def imported(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


@pytest.mark.parametrize("place", WITHOUT_MUJOCO)
def test_rooms_that_know_no_mujoco(place: str) -> None:
    for path in files(place):
        assert not {name.split(".")[0] for name in imported(path)} & HEAVY, path


def test_perception_meets_mujoco_in_the_renderer_alone() -> None:
    users = [path.name for path in files("tral_env/perception") if "mujoco" in imported(path)]
    assert users == ["camera.py"]


def test_only_the_scene_builds_models() -> None:
    users = [path.name for path in files("tral_env") if ".compile()" in path.read_text()]
    assert users == ["scene.py"]


def test_the_environment_does_not_know_the_state_machine() -> None:
    for path in files("tral_env"):
        assert not any(name.startswith("tral_fsm") for name in imported(path)), path


def test_the_state_machine_knows_only_the_waist() -> None:
    outside = {"bench", "cli", "evaluation", "report", "tuning"}
    allowed = {"tral_env.interface", "tral_env.errors"}
    for path in files("tral_fsm"):
        if path.relative_to(ROOT / "tral_fsm").parts[0] in outside:
            continue
        assert {name for name in imported(path) if name.startswith("tral_env")} <= allowed, path


def test_the_shells_do_not_know_each_other() -> None:
    assert "tral_env.vector_env" not in imported(ROOT / "tral_env/env.py")
    assert "tral_env.env" not in imported(ROOT / "tral_env/vector_env.py")


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, tral_env; print([m for m in ('mujoco', 'cv2', 'torch', 'matplotlib') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"
