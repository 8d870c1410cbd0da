from __future__ import annotations

import inspect
import json
import os
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import tral_env
from tral_env.course.generate import SCENARIOS
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, example_names, example_path
from tral_env.env import TralCorridorEnv
from tral_env.errors import SimulationError
from tral_env.installation import CPU_TORCH
from tral_fsm.cli import app
from tral_fsm.cli.courses import seeded_course
from tral_fsm.cli.drive import command as drive_command

SHORT = {"name": "short", "segments": [{"length": 4.0}]}
"""A course that is driven in a few seconds."""
ROOT = Path(__file__).parents[2]
STEADY = ["--policy", "wall", "--camera", "projected", "--randomization", "none"]
CALM = [*STEADY, "--scenario", "straight"]


def tral(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("courses") / "short.json"
    path.write_text(json.dumps(SHORT))
    return path


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory, short: Path) -> tuple[Path, Result]:
    out = tmp_path_factory.mktemp("runs") / "first"
    return out, tral("drive", *STEADY, "--course", short, "--seed", 3, "--no-video", "--json", "--out", out)


def test_the_version_is_that_of_the_package() -> None:
    assert tral("--version").stdout == f"tral {tral_env.__version__}\n"


def test_help_does_not_load_the_simulation() -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from tral_fsm.cli import app;"
        "CliRunner().invoke(app, ['drive', '--help']);"
        "print({'mujoco', 'cv2', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_json_on_stdout_is_the_summary_and_nothing_else(driven: tuple[Path, Result]) -> None:
    out, result = driven
    assert json.loads(result.stdout) == json.loads((out / "summary.json").read_text())


def test_the_exit_code_says_whether_the_car_arrived(driven: tuple[Path, Result]) -> None:
    _, result = driven
    report = json.loads(result.stdout)
    assert report["complete"]
    assert result.exit_code == (0 if report["episodes"][0]["success"] else 1)


def test_one_episode_leaves_its_pictures_in_the_folder_itself(driven: tuple[Path, Result]) -> None:
    out, result = driven
    assert sorted(path.name for path in out.iterdir()) == ["summary.json", "trajectory.png"]
    assert json.loads(result.stdout)["episodes"][0]["files"] == ["trajectory.png"]


def test_the_summary_says_what_it_depends_on(driven: tuple[Path, Result]) -> None:
    report = json.loads(driven[1].stdout)
    assert report["arguments"]["seed"] == 3
    assert report["versions"]["tral-env"] == tral_env.__version__
    assert report["episodes"][0]["seed"] == 3


def test_several_episodes_have_a_subfolder_each_and_replace_an_earlier_drive(tmp_path: Path, short: Path) -> None:
    calm = [*STEADY, "--course", short]
    tral("drive", *calm, "--no-video", "--out", tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    result = tral("drive", *calm, "--seed", 3, "--episodes", 2, "--no-video", "--out", tmp_path)
    files = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    assert files == ["notes.txt", "seed_3/trajectory.png", "seed_4/trajectory.png", "summary.json"]
    for heading in ("success", "progress", "time", "speed", "RMSE", "gates", "collisions"):
        assert heading in result.stdout


def test_a_course_file_is_driven_under_its_name(driven: tuple[Path, Result]) -> None:
    assert json.loads(driven[1].stdout)["episodes"][0]["scenario"] == "short"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["drive", "--scenario", "cornrs"], "unknown scenario 'cornrs': did you mean 'corners'?"),
        (["drive", "--policy", "wal"], "did you mean 'wall'?"),
        (["drive", "--policy", "runs/student"], "no folder with the policy.json of a training"),
        (["courses", "--scenario", "ofice"], "did you mean 'office'?"),
        (["courses", "--out", "a.json"], "a course file holds one course, so --scenario or --course is needed"),
        (["courses", "--course", "l_shap"], "did you mean 'l_shape'?"),
        (["courses", "--course", "ring", "--scenario", "loop"], "expected one of them"),
        (["courses", "--course", "ring", "--seed", "7"], "--seed 7 and --course ring: expected one of them"),
        (["courses", "--course", "ring", "--out", "a.bmp"], "got suffix '.bmp': Allowed: .png, .json"),
        (["drive", "--course", "l_shap"], "did you mean 'l_shape'?"),
        (
            ["drive", "--course", "ring", "--scenario", "loop"],
            "--scenario loop and --course ring: expected one of them",
        ),
        (["tune", "--course", "ring", "--scenario", "loop"], "--scenario loop and --course ring: expected one"),
        (["tune", "--course", "rin"], "did you mean 'ring'?"),
        (["drive", "--car", "frction=0.6"], "--car frction=0.6: unknown parameter 'frction': did you mean 'friction'?"),
        (["drive", "--car", "friction"], "--car friction: expected NAME=VALUE with a number"),
        (["drive", "--car", "friction=-1"], "expected numbers above 0"),
        (["drive", "--car", "friction=1", "--car", "friction=2"], "--car friction=2: friction is set twice"),
        (["drive", "--randomization", "hrd"], "did you mean 'hard'?"),
        (["drive", "--randomization", "no.yaml"], "randomization no.yaml: cannot be read"),
        (["drive", "--policy", "no.py:P"], "Python file no.py: there is no such file"),
        (["courses", "--out", "a.bmp"], "got suffix '.bmp': Allowed: .png, .json"),
        (["tune", "--params", "*.p=3"], "*.p=3: expected LOW:HIGH"),
        (["tune", "--params", "*.d=3:1"], "*.d=3:1: expected the lower end first"),
        (["tune", "--params", "*.p=1:inf"], "*.p=1:inf: expected finite numbers"),
        (["tune", "--params", "*.d=-1:2"], "state[0].d=-1:2: the definition allows 0 to 1000"),
        (["tune", "--params", "*.q"], "no parameter of the machine is called '*.q'"),
        (["tune", "--seeds", "5"], "--seeds 5: expected FIRST:END"),
        (["tune", "--seeds", "0:8", "--report-seeds", "4:9"], "seeds 4 to 8 are for tuning and for the report"),
        (["tune", "--scenario", "strait"], "did you mean 'straight'?"),
    ],
)
def test_bad_usage_is_said_in_a_line_and_exits_with_2(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = tral(*arguments)
    assert result.exit_code == 2
    assert message in " ".join(result.stderr.split())
    assert result.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_a_backend_that_does_not_load_exits_with_3_and_names_the_remedy(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from tral_fsm.cli import app; app()", "drive", "--out", str(tmp_path / "out")],
        env={**os.environ, "MUJOCO_GL": "nonsense"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    assert "unset MUJOCO_GL or set it to one of" in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", [["drive", *CALM, "--no-video"], ["tune"], ["courses"]])
def test_a_folder_that_cannot_be_made_is_said_before_anything_is_driven(command: list[str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = tral(*command, "--out", tmp_path / "file" / ("a.png" if command == ["courses"] else "a"))
    assert result.exit_code == 2
    assert "cannot be written" in result.stderr
    assert "%" not in result.stderr


def test_a_drive_that_was_interrupted_leaves_a_summary_and_the_next_does_not_claim_its_files(
    tmp_path: Path, short: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        (tmp_path / "drive.mp4").write_text("half")
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("tral_fsm.evaluation.rollout.drive", interrupted)
        stopped = tral("drive", *CALM, "--no-video", "--out", tmp_path)
    assert stopped.exit_code == 130
    assert f"Stopped. The episodes that had ended are in {tmp_path}\n" in stopped.stderr
    left = json.loads((tmp_path / "summary.json").read_text())
    assert (left["complete"], left["episodes"]) == (False, [])
    result = tral("drive", *STEADY, "--course", short, "--no-video", "--json", "--out", tmp_path)
    assert json.loads(result.stdout)["episodes"][0]["files"] == ["trajectory.png"]


def test_figures_are_whole_in_a_narrow_terminal(tmp_path: Path, short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    result = tral("drive", *STEADY, "--course", short, "--seed", 10**20, "--no-video", "--out", tmp_path)
    assert str(10**20) in result.stdout
    assert "…" not in result.stdout


def test_a_state_may_be_called_what_looks_like_markup_or_a_formula(tmp_path: Path, short: Path) -> None:
    states = [{"id": "[/b] $\\x$", "type": "Motor", "speed": 0.5, "final": True}]
    (tmp_path / "odd.json").write_text(json.dumps({"root": states[0]["id"], "states": states}))
    arguments = ["--course", short, "--policy", tmp_path / "odd.json", "--camera", "projected", "--no-video"]
    assert tral("drive", *arguments, "--out", tmp_path / "out").exit_code in (0, 1)
    assert (tmp_path / "out" / "trajectory.png").exists()


def test_physics_that_become_unstable_are_a_failed_episode_and_not_bad_usage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unstable(*_: object, **__: object) -> None:
        raise SimulationError("NaN")

    monkeypatch.setattr("tral_fsm.evaluation.rollout.drive", unstable)
    assert tral("drive", *CALM, "--no-video", "--out", tmp_path).exit_code == 1


def test_courses_lists_every_family_with_what_it_is() -> None:
    listed = " ".join(tral("courses").stdout.split())
    assert all(name in listed for name in SCENARIOS)


def test_courses_of_a_seed_are_told_without_a_picture() -> None:
    told = tral("courses", "--seed", 7, "--scenario", "gates")
    assert told.exit_code == 0
    course = seeded_course("gates", 7)
    gates = sum(len(segment.gates) for segment in course.segments)
    turns = sum(segment.then in ("left", "right") for segment in course.segments)
    row = next(line for line in told.stdout.splitlines() if line.startswith("│ gates"))
    assert [cell.strip() for cell in row.strip("│").split("│")] == [
        "gates", f"{build_plan(course).length:.1f} m", str(turns), "0", "0", "0", str(gates),
    ]  # fmt: skip
    assert "tral courses --scenario gates --seed 7 --out gates.png" in told.stdout
    every = tral("courses", "--seed", 7).stdout
    assert all(f"│ {name} " in every for name in SCENARIOS)
    assert tral("courses", "--seed", 8).stdout != every
    assert tral("courses", "--seed", 7, "--randomization", "hard").stdout != every


@pytest.mark.parametrize("randomization", ["default", "hard"])
def test_a_course_file_is_the_course_that_the_env_drives(tmp_path: Path, randomization: str) -> None:
    import gymnasium as gym

    out, hard = tmp_path / "gates.json", randomization == "hard"
    tral("courses", "--scenario", "gates", "--seed", 7, "--randomization", randomization, "--out", out)
    env = gym.make("tral_env:TralCorridor-v0", scenario="gates", randomization=randomization)
    env.reset(seed=7)
    course = env.unwrapped.course  # type: ignore[attr-defined]
    assert Course.load(out) == course == seeded_course("gates", 7, hard=hard)
    assert (course == seeded_course("gates", 7)) is not hard
    env.close()


@pytest.mark.parametrize(("arguments", "name"), [(["--scenario", "gates"], "gates.PNG"), ([], "sheet.png")])
def test_courses_are_drawn(arguments: list[str], name: str, tmp_path: Path) -> None:
    out = tmp_path / name
    assert tral("courses", *arguments, "--out", out).exit_code == 0
    assert out.read_bytes().startswith(b"\x89PNG")


@pytest.fixture
def one_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    """The doctor starts a Python for each backend of OpenGL; one is enough."""
    monkeypatch.setattr("tral_env.perception.opengl.backends", lambda: ("egl",))


def without_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    """No distribution of this name is found."""
    version = metadata.version

    def found(name: str) -> str:
        if name == "torch":
            raise metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(metadata, "version", found)


def test_the_doctor_finds_the_core_working_and_says_a_remedy_for_all_that_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asks = ["numpy>=2.0", "no-such-package[all]>=3.2; extra == 'rl'", "torch>=2; extra == 'rl'", "ruff; extra == 'dev'"]
    without_torch(monkeypatch)
    monkeypatch.setattr("tral_fsm.cli.doctor.metadata.requires", {"tral-env": asks}.get)
    result = tral("doctor", "--json")
    report = json.loads(result.stdout)
    assert (result.exit_code, report["core_works"]) == (0, True)
    found = {f"{finding['topic']}: {finding['name']}": finding for finding in report["findings"]}
    assert found["extra rl: no-such-package"]["remedy"] == "pip install 'no-such-package[all]>=3.2'"
    assert found["extra rl: torch"]["remedy"] == f"pip install 'torch>=2'; {CPU_TORCH}"
    assert found["core: numpy"]["ok"]
    assert not any("ruff" in name for name in found)
    assert found["plugin: -"]["detail"] == "no entry point of the group tral_fsm.states"
    assert found["core: env without OpenGL"]["detail"].endswith("steps/s")
    assert all(finding["ok"] != bool(finding["remedy"]) for finding in report["findings"])


@pytest.mark.usefixtures("one_backend")
def test_the_doctor_tells_why_there_is_no_encoder_and_apart_from_it_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    class Unloadable:
        def find_spec(self, name: str, path: object = None, target: object = None) -> None:
            if name == "av":
                raise ImportError("libx264.so: cannot open shared object file: No such file")

    monkeypatch.delitem(sys.modules, "av", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Unloadable(), *sys.meta_path])
    findings = json.loads(tral("doctor", "--json").stdout)["findings"]
    found = next(each for each in findings if each["name"] == "encoder")
    assert found["detail"] == "no encoder for videos (libx264.so: cannot open shared object file: No such file)"
    assert found["remedy"].startswith("pip install --force-reinstall av")


OWN = """
class Own:
    active_states = ["rolling"]

    def act(self, observation):
        return [0.0, 0.3]


class Fragile:
    def act(self, observation):
        return 1 / 0
"""


def test_a_policy_of_one_s_own_gets_all_that_a_machine_gets(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "level.yaml").write_text("base: default\nfriction: [0.5, 0.6]\n")
    arguments = ["--policy", tmp_path / "own.py:Own", "--course", "short", "--randomization", tmp_path / "level.yaml"]
    out = tmp_path / "out"
    result = tral("drive", *arguments, "--car", "battery_v=6.8", "--no-video", "--trace", "--out", out)
    assert result.exit_code == 0, result.stderr
    assert "own.py:Ownonshort,projectedcamera" in "".join(result.stdout.split())  # a long path breaks the title
    assert sorted(path.name for path in out.iterdir()) == ["summary.json", "trace.csv", "trajectory.png"]
    assert (out / "trace.csv").read_text().splitlines()[1].split(",")[:3] == ["0", "0.0125", "rolling"]
    assert json.loads((out / "summary.json").read_text())["arguments"]["car"] == {"battery_v": 6.8}


def test_a_policy_that_fails_is_told_in_a_line_and_exits_with_1(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    policy = f"{tmp_path / 'own.py'}:Fragile"
    result = tral("drive", "--policy", policy, "--course", "short", "--no-video", "--out", tmp_path / "out")
    assert result.exit_code == 1
    told = f"Error: policy {policy} failed at 0.01 s: ZeroDivisionError: division by zero (own.py, line 11)"
    assert result.stderr.splitlines()[-1] == told


def test_a_state_that_fails_is_told_in_a_line_and_exits_with_1(tmp_path: Path) -> None:
    code = """
import sys
from typing import Literal
from tral_fsm import states
from tral_fsm.cli import app
from tral_fsm.definition.machine import StateSpec

class WeaveSpec(StateSpec):
    type: Literal["Weave"] = "Weave"

@states.register
class Weave(states.State[WeaveSpec]):
    def tick(self, estimate):
        return self.spec.swing

open("m.json", "w").write('{"root": 0, "states": [{"id": 0, "type": "Weave", "final": true}]}')
sys.argv = ["tral", "drive", "--policy", "m.json", "--course", "short", "--no-video"]
app()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "Error: state 0 (Weave) failed at 0.01 s: AttributeError: " in done.stderr


def test_the_command_and_gym_make_have_the_same_camera_by_default() -> None:
    default = inspect.signature(TralCorridorEnv).parameters["camera"].default
    assert inspect.signature(drive_command).parameters["camera"].default == default


def test_a_car_that_is_set_is_the_car_that_drives(tmp_path: Path) -> None:
    times = []
    for friction in ("friction=0.9", "friction=0.9", "friction=0.05"):
        arguments = [*STEADY, "--course", "short", "--car", friction, "--no-video", "--json", "--out", tmp_path]
        times.append(json.loads(tral("drive", *arguments).stdout)["episodes"][0]["time_s"])
    assert times[0] == times[1] < times[2]


def test_courses_with_a_name_are_listed_and_checked() -> None:
    listed = " ".join(tral("courses").stdout.split())
    assert all(name in listed for name in example_names())
    checked = tral("courses", "--course", "one_gate")
    assert checked.exit_code == 0
    assert checked.stdout == "one_gate: can be driven: 'one_gate', a route of 7.0 m, 1 gate\n"


def test_a_course_file_is_checked_and_drawn(tmp_path: Path, short: Path) -> None:
    assert tral("courses", "--course", short, "--out", tmp_path / "short.png").exit_code == 0
    assert (tmp_path / "short.png").read_bytes().startswith(b"\x89PNG")
    assert tral("courses", "--course", "ring", "--out", tmp_path / "mine.json").exit_code == 0
    assert Course.load(tmp_path / "mine.json") == Course.load(example_path("ring"))
    (tmp_path / "bad.json").write_text('{"name": "bad", "segments": [{"length": 0.1, "obstacles": [{"at": 1}]}]}')
    result = tral("courses", "--course", tmp_path / "bad.json", "--out", tmp_path / "bad.png")
    assert result.exit_code == 1
    assert "/segments/0/length: got 0.1. Allowed: greater than or equal to 1" in result.stderr
    (tmp_path / "blocked.json").write_text(
        '{"name": "b", "segments": [{"length": 9, "obstacles": [{"at": 5, "width": 1.9}]}]}'
    )
    result = tral("courses", "--course", tmp_path / "blocked.json")
    assert result.exit_code == 1
    assert result.stdout == ""
    assert not (tmp_path / "bad.png").exists()


def test_the_doctor_examines_what_the_distribution_asks_for(one_backend: None) -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    extras = {name: asks for name, asks in project["optional-dependencies"].items() if name != "dev"}
    expected = {("core", re.split(r"[\[>]", ask)[0]) for ask in project["dependencies"]} | {
        (f"extra {extra}", re.split(r"[\[>]", ask)[0]) for extra, asks in extras.items() for ask in asks
    }
    findings = json.loads(tral("doctor", "--json").stdout)["findings"]
    assert expected <= {(finding["topic"], finding["name"]) for finding in findings}
    assert not any("tral-env" in finding["remedy"] for finding in findings)


def test_the_doctor_says_how_to_mend_a_mujoco_that_cannot_be_imported(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, one_backend: None
) -> None:
    (tmp_path / "mujoco").mkdir()
    (tmp_path / "mujoco" / "__init__.py").write_text("import mujoco._specs")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    result = tral("doctor", "--json")
    (physics,) = [each for each in json.loads(result.stdout)["findings"] if each["name"] == "env without OpenGL"]
    assert (result.exit_code, physics["ok"]) == (3, False)
    assert physics["remedy"] == "pip install --force-reinstall 'mujoco>=4.0'"
