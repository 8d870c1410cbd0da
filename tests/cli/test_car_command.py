"""`tral car`: a file to begin with, what is wrong with a car, exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tral_env.hardware.bringup import guide, preflight
from tral_env.hardware.bringup.preflight import Finding
from tral_env.hardware.car_file import load_car
from tral_fsm.cli import app

RUN = CliRunner()


def test_init_writes_a_file_that_is_read(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    done = RUN.invoke(app, ["car", "init", str(path), "--name", "red one", "--board", "ucboard", "--no-camera"])
    assert done.exit_code == 0
    assert f"tral car calibrate {path}" in done.output
    car = load_car(path)
    assert (car.name, car.board.driver, car.camera) == ("red one", "ucboard", None)


def test_init_replaces_no_file_unless_told(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text("precious")
    assert RUN.invoke(app, ["car", "init", str(path)]).exit_code == 2
    assert path.read_text() == "precious"
    assert RUN.invoke(app, ["car", "init", str(path), "--force", "--sensor", "srf02"]).exit_code == 0
    assert [sensor.driver for sensor in load_car(path).sensors] == ["srf02"]


@pytest.mark.parametrize(
    ("place", "told"),
    [("nodir/car.toml", "there is no folder"), ("x\ny.toml", "expected a line of text"), ("folder", "cannot write")],
)
def test_init_tells_a_file_that_cannot_be(tmp_path: Path, place: str, told: str) -> None:
    (tmp_path / "folder").mkdir()
    done = RUN.invoke(app, ["car", "init", str(tmp_path / place), "--force"])
    assert done.exit_code == 2
    assert told in " ".join(done.output.split())
    assert sorted(each.name for each in tmp_path.iterdir()) == ["folder"]


@pytest.mark.parametrize("option", [["--name", "x\ny"], ["--name", ""], ["--sensor", "hall", "--sensor", "hall"]])
def test_init_writes_nothing_that_is_no_car(tmp_path: Path, option: list[str]) -> None:
    path = tmp_path / "car.toml"
    assert RUN.invoke(app, ["car", "init", str(path), *option]).exit_code == 2
    assert not path.exists()


def test_init_writes_a_car_without_sensors(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    assert RUN.invoke(app, ["car", "init", str(path), "--sensor", "none"]).exit_code == 0
    assert load_car(path).sensors == ()


def test_init_names_the_nearest_board(tmp_path: Path) -> None:
    done = RUN.invoke(app, ["car", "init", str(tmp_path / "car.toml"), "--board", "pca9658"])
    assert done.exit_code == 2
    assert "did you mean 'pca9685'" in done.output


@pytest.mark.parametrize(("missing", "code"), [((), 0), (("hall",), 1)])
def test_calibrate_fails_while_steps_are_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: tuple[str, ...], code: int
) -> None:
    asked = []
    monkeypatch.setattr(guide, "calibrate", lambda path, steps: asked.append((path, steps)) or missing)
    done = RUN.invoke(app, ["car", "calibrate", str(tmp_path / "car.toml"), "--step", "hall"])
    assert done.exit_code == code
    assert asked == [(tmp_path / "car.toml", ["hall"])]


@pytest.mark.parametrize(("problem", "code"), [("", 0), ("no answer", 1)])
def test_check_tells_each_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, problem: str, code: int) -> None:
    path = tmp_path / "car.toml"
    RUN.invoke(app, ["car", "init", str(path)])
    found = [Finding(what="calibration"), Finding(what="srf08", problem=problem, told="left 1.00 m")]
    monkeypatch.setattr(preflight, "check_car", lambda car: found)
    plain = RUN.invoke(app, ["car", "check", str(path)])
    assert plain.exit_code == code
    assert plain.output.splitlines()[0] == "ok      calibration"
    assert plain.output.splitlines()[1] == ("PROBLEM srf08: no answer" if problem else "ok      srf08: left 1.00 m")
    machine = RUN.invoke(app, ["car", "check", str(path), "--json"])
    assert json.loads(machine.output)[1] == {"what": "srf08", "problem": problem, "told": "left 1.00 m"}


def test_a_file_with_a_mistake_is_told_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    RUN.invoke(app, ["car", "init", str(path)])
    path.write_text(path.read_text().replace("max_throttle = 0.4", "max_throttle = 40"))
    done = RUN.invoke(app, ["car", "check", str(path)])
    assert done.exit_code == 1
    assert "limits.max_throttle: got 40: expected 0 to 1; is it in %?" in done.output
