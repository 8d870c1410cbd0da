"""What somebody new to the command types wrong is told in a line, with the remedy."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from tral_fsm.cli import app


def tral(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("drive", "wall.json"), "Did you mean --policy wall.json?"),
        (("courses", "mine.json"), "Did you mean --course mine.json?"),
        (("compare", "office", "wall"), "Did you mean --policies office?"),
        (("tune", "wall"), "Did you mean --policy wall?"),
        (("train", "corners"), "Did you mean --scenario corners?"),
        (("drive", "--scenario", "ring"), "it is a course, so write --course ring"),
        (("drive", "--course", "office"), "or --scenario office on the command line"),
    ],
)
def test_a_name_in_the_wrong_place_is_told_where_it_belongs(arguments: tuple[str, ...], told: str) -> None:
    result = tral(*arguments)
    assert told in result.stderr
    assert result.exit_code == 2


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("mine.json", ("fsm", "check")),
        ("mine.json", ("courses", "--course")),
        ("mine.yaml", ("drive", "--randomization")),
        ("mine.yaml", ("drive", "--lens")),
    ],
)
def test_a_file_in_the_encoding_of_windows_is_told_to_be_saved_as_utf_8(
    name: str, arguments: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes('{"name": "Größe"}'.encode("cp1252"))
    result = tral(*arguments, tmp_path / name)
    assert "not UTF-8 text: invalid start byte at byte 12: save it as UTF-8" in result.output
    assert result.exit_code != 0


def test_a_python_file_in_the_encoding_of_windows_is_told_to_be_saved_as_utf_8(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_bytes('NAME = "Größe"\n'.encode("cp1252"))
    result = tral("drive", "--policy", f"{tmp_path / 'mine.py'}:P", "--out", tmp_path / "runs")
    assert ": save it as UTF-8" in result.stderr
    assert result.exit_code == 1


@pytest.mark.parametrize(
    ("code", "remedy"),
    [(errno.ENOSPC, "make room, or choose another folder"), (errno.EROFS, "choose another folder")],
)
def test_a_disk_that_takes_nothing_is_told_in_a_line(
    code: int, remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(Path, "write_bytes", full)
    result = tral("courses", "--scenario", "straight", "--out", tmp_path / "straight.png")
    assert result.stderr == f"Error: {tmp_path / 'straight.png'}: cannot be written: {os.strerror(code)}: {remedy}\n"
    assert result.exit_code == 2


def test_an_error_of_the_program_itself_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise FileNotFoundError(errno.ENOENT, "No such file", "inner.txt")

    monkeypatch.setattr("tral_env.randomization.level", broken)
    assert isinstance(tral("courses").exception, FileNotFoundError)


@pytest.mark.parametrize(
    ("parameter", "told"),
    [
        ('"clearance": 800', "got 800: expected 5 or less, in m"),
        ('"clearance": "600 mm"', 'got "600 mm": expected a number, in m'),
        ('"speed": "0,5"', 'got "0,5": expected a number, in m/s. A decimal comma? Write 0.5'),
        ('"steering_trim": 2', "got 2: expected 1 or less\n"),
    ],
)
def test_a_parameter_in_another_unit_is_told_with_its_unit(parameter: str, told: str, tmp_path: Path) -> None:
    state = f'{{"id": 0, "type": "BasicFollowWall", "throttle": 0.2, {parameter}, "final": true}}'
    (tmp_path / "mine.json").write_text(f'{{"root": 0, "states": [{state}]}}')
    assert told in tral("fsm", "check", tmp_path / "mine.json").output


@pytest.mark.parametrize(
    "arguments",
    [
        ("drive", "--scenario", "straight", "--no-video", "--out", "note.txt/runs"),
        ("tune", "--policy", "wall", "--params", "*.p", "--budget", "12", "--out", "note.txt/runs"),
        ("fsm", "convert", "wall", "note.txt/wall.json"),
        ("fsm", "draw", "wall", "--out", "note.txt/wall.svg"),
        ("courses", "--course", "ring", "--out", "note.txt/ring.png"),
    ],
)
def test_a_file_where_a_folder_has_to_be_is_named(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "note.txt").write_text("a file")
    result = tral(*arguments)
    assert "cannot be written: note.txt is a file, not a folder: choose another folder" in result.stderr
    assert result.exit_code == 2


@pytest.mark.parametrize("arguments", [("tune", "--policy"), ("fsm", "draw", "--out", "x.svg"), ("fsm", "check")])
def test_a_command_for_machines_offers_no_trained_policy(arguments: tuple[str, ...]) -> None:
    result = tral(*arguments, "student")
    assert "'student' is no packaged machine, and no file of one (.json, " in result.output
    assert "training" not in result.output
    assert result.exit_code == 2
