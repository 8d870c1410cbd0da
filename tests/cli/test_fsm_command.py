"""`tral fsm`: exit codes, messages, files."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from typer.testing import CliRunner, Result

from tral_fsm import load_machine, machine_names
from tral_fsm.cli import app
from tral_fsm.definition import packaged
from tral_fsm.definition.conditions import CONDITIONS
from tral_fsm.definition.machine import STATES
from tral_fsm.formats.tral_json import loads

BAD = """{"root": 0, "states": [
  {"id": 0, "type": "FolowWall", "speed": 0.5},
  {"id": 1, "type": "Motor", "speed": 99}
]}"""


def tral(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["fsm", *(str(argument) for argument in arguments)])


def flat(text: str) -> str:
    return " ".join(text.split())


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def bad(folder: Path) -> Path:
    (folder / "bad.json").write_text(BAD)
    return Path("bad.json")


def test_packaged_machines_are_fine() -> None:
    result = tral("check", *machine_names())
    assert result.exit_code == 0
    assert "wall: fine: 1 state, 0 transitions\n" in result.stdout
    assert result.stderr == ""


def test_a_bad_file_exits_with_1_and_all_problems_each_with_file_and_place(bad: Path) -> None:
    result = tral("check", "wall", bad)
    assert result.exit_code == 1
    assert result.stderr == ""
    fine, *lines = result.stdout.splitlines()
    assert fine == "wall: fine: 1 state, 0 transitions"
    assert len(lines) == 2
    assert lines[0].startswith("bad.json: /states/0/type: ")
    assert "did you mean 'FollowWall'?" in lines[0]
    assert lines[1].startswith("bad.json: /states/1/speed: ")


def test_a_file_that_is_not_there_exits_with_2_and_the_others_are_told_all_the_same(bad: Path) -> None:
    result = tral("check", "nowhere.json", bad)
    assert result.exit_code == 2
    assert result.stderr.startswith("nowhere.json: cannot be read: No such file")
    assert result.stdout.startswith("bad.json: /states/0/type")


def test_a_name_that_umlet_reads_as_a_command_is_noted() -> None:
    states = [{"id": name, "type": "Stop"} for name in ("bg=red", "--", "lw=3", "// c", "a=b")]
    states.append({"id": "fg=blue", "label": "brakes", "type": "Stop"})
    ways = [{"id": k, "type": "Timer", "seconds": k + 1, "from": "bg=red", "to": s["id"]} for k, s in enumerate(states)]
    Path("names.json").write_text(json.dumps({"root": "bg=red", "states": states, "transitions": ways[1:]}))
    result = tral("check", "names.json")
    assert result.exit_code == 0
    assert [line.partition(": UMLet")[0] for line in result.stdout.splitlines()] == [
        "names.json: fine: 6 states, 5 transitions",
        "names.json: note: state 'bg=red'",
        "names.json: note: state '--'",
        "names.json: note: state 'lw=3'",
        "names.json: note: state '// c'",
    ]
    assert len(json.loads(tral("check", "--json", "names.json").stdout)["files"][0]["notes"]) == 4
    assert "Note: state 'bg=red': UMLet reads the title" in flat(tral("convert", "names.json", "names.uxf").stderr)


def test_a_bad_course_file_exits_as_a_bad_machine_file_does() -> None:
    Path("course.json").write_text('{"name": "a", "segments": []}')
    result = CliRunner().invoke(app, ["drive", "--course", "course.json", "--camera", "projected", "--no-video"])
    assert result.exit_code == 1
    assert "course.json: 1 problem" in flat(result.stderr)


def test_json_is_one_object_and_nothing_else(bad: Path) -> None:
    result = tral("check", "--json", "gate", bad)
    assert result.exit_code == 1
    assert result.stderr == ""
    report = json.loads(result.stdout)
    assert report["ok"] is False
    assert [(entry["file"], entry["ok"]) for entry in report["files"]] == [("gate", True), ("bad.json", False)]
    assert [p["pointer"] for p in report["files"][1]["problems"]] == ["/states/0/type", "/states/1/speed"]


def test_without_a_file_it_is_bad_usage() -> None:
    assert tral("check").exit_code == 2


@pytest.mark.parametrize("suffix", ["json", "uxf", "scxml"])
def test_what_is_converted_is_the_same_machine(suffix: str) -> None:
    assert tral("convert", "gate", f"mine.{suffix}").exit_code == 0
    assert load_machine(f"mine.{suffix}") == load_machine("gate")


@pytest.mark.parametrize(("suffix", "start"), [("mmd", "---"), ("puml", "@startuml")])
def test_pages_are_drawn_from_text(suffix: str, start: str) -> None:
    assert tral("convert", "gate", f"mine.{suffix}").exit_code == 0
    assert Path(f"mine.{suffix}").read_text().startswith(start)


def test_the_format_may_be_named() -> None:
    assert tral("convert", "gate", "gate.txt", "--to", "mermaid").exit_code == 0
    assert "stateDiagram-v2" in Path("gate.txt").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["convert", "gate", "gate.dot"], "gate.dot: got suffix '.dot': "),
        (["convert", "gate", "gate.json", "--to", "scmxl"], "--to scmxl: did you mean 'scxml'? Allowed: json, uxf"),
        (["convert", "gate", "gate.json", "--to", "xml2json"], "--to xml2json: "),
        (["convert", "gatte", "gate.json"], "did you mean 'gate'?"),
        (["convert", "nowhere.uxf", "gate.json"], "nowhere.uxf: cannot be read"),
        (["convert", "gate", ".", "--to", "json"], ".: is a folder"),
        (["draw", "gate", "-o", "gate.gif"], "--out gate.gif: got suffix '.gif': "),
        (["draw", "gate"], "Missing option"),
        (["new", ""], "got '.': name a file"),
        (["new", ".."], "got '..': name a file"),
        (["new", "/"], "got '/': name a file"),
        (["new", "mine.puml"], "mine.puml: got suffix '.puml': "),
        (["states", "Folow"], "unknown state or condition 'Folow': did you mean 'FollowWall'?"),
    ],
)
def test_bad_usage_is_said_in_a_line_exits_with_2_and_leaves_no_file(
    arguments: list[str], message: str, folder: Path
) -> None:
    result = tral(*arguments)
    assert result.exit_code == 2
    assert message in flat(result.stderr)
    assert result.stdout == ""
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("arguments", [["convert", "bad.json", "kept.uxf"], ["draw", "bad.json", "-o", "kept.svg"]])
def test_a_bad_file_replaces_nothing(arguments: list[str], bad: Path, folder: Path) -> None:
    kept = folder / arguments[-1]
    kept.write_text("mine")
    result = tral(*arguments)
    assert result.exit_code == 1
    assert "bad.json: 2 problems" in flat(result.stderr)
    assert kept.read_text() == "mine"
    assert sorted(path.name for path in folder.iterdir()) == sorted(["bad.json", kept.name])


def test_a_file_is_converted_onto_itself(folder: Path) -> None:
    tral("convert", "gate", "mine.json")
    assert tral("convert", "mine.json", "mine.json").exit_code == 0
    assert load_machine("mine.json") == load_machine("gate")
    assert [path.name for path in folder.iterdir()] == ["mine.json"]


def test_a_bad_file_is_no_bad_usage_for_tral_drive_either(bad: Path, folder: Path) -> None:
    result = CliRunner().invoke(app, ["drive", "--policy", str(bad), "--json", "--out", "runs"])
    assert (result.exit_code, result.stdout) == (1, "")
    assert "bad.json: 2 problems" in flat(result.stderr)
    assert CliRunner().invoke(app, ["drive", "--policy", "nowhere.json"]).exit_code == 2
    assert not Path("runs").exists()


def test_what_is_no_file_is_written_to_and_never_replaced() -> None:
    os.mkfifo("pipe")
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(Path("pipe").read_text()))
    reader.start()
    result = tral("convert", "wall", "pipe", "--to", "json")
    reader.join()
    assert result.exit_code == 0
    assert result.stdout == ""
    assert "Written: pipe" in result.stderr
    assert Path("pipe").is_fifo()
    assert loads(read[0]) == load_machine("wall")


def test_a_pipe_is_read() -> None:
    os.mkfifo("pipe")
    writer = threading.Thread(target=lambda: Path("pipe").write_text(packaged.text("wall")))
    writer.start()
    result = tral("check", "pipe")
    writer.join()
    assert result.stdout == "pipe: fine: 1 state, 0 transitions\n"


def test_a_link_stays_one(folder: Path) -> None:
    (folder / "real.json").write_text("old")
    (folder / "link.json").symlink_to("real.json")
    assert tral("convert", "wall", "link.json").exit_code == 0
    assert Path("link.json").is_symlink()
    assert load_machine("real.json") == load_machine("wall")


def test_a_picture_too_large_for_a_png_says_so() -> None:
    states = [{"id": k, "type": "Idle"} for k in range(150)]
    ways = [{"id": k, "type": "Timer", "seconds": 1, "from": k, "to": (k + 1) % 150} for k in range(150)]
    Path("long.json").write_text(json.dumps({"root": 0, "states": states, "transitions": ways}))
    result = tral("draw", "long.json", "-o", "long.png", "--direction", "right")
    assert result.exit_code == 0
    assert "too large for a .png: try .svg" in flat(result.stderr)


def test_a_folder_that_cannot_be_made_is_said(folder: Path) -> None:
    (folder / "file").write_text("")
    result = tral("convert", "gate", "file/gate.json")
    assert result.exit_code == 2
    assert flat(result.stderr).startswith("Error: file/gate.json: cannot be written")


def test_pictures_are_drawn_by_suffix(folder: Path) -> None:
    assert tral("draw", "gate", "-o", "deep/gate.svg").exit_code == 0
    assert tral("draw", "gate", "-o", "gate.PNG").exit_code == 0
    assert ET.parse("deep/gate.svg").getroot().tag.endswith("svg")
    assert Path("gate.PNG").read_bytes().startswith(b"\x89PNG")


def test_the_direction_may_be_chosen() -> None:
    size = {}
    for direction in ("right", "down"):
        tral("draw", "gate", "-o", "gate.svg", "--direction", direction)
        root = ET.parse("gate.svg").getroot()
        size[direction] = int(root.attrib["width"]) > int(root.attrib["height"])
    assert size == {"right": True, "down": False}


@pytest.mark.parametrize("name", ["mine", "mine.json", "mine.uxf", "mine.scxml"])
def test_a_new_machine_is_fine_and_named(name: str) -> None:
    result = tral("new", name)
    path = name if "." in name else f"{name}.json"
    assert f"tral drive --policy {path}" in result.stdout
    assert tral("check", path).exit_code == 0
    machine = load_machine(path)
    assert machine.name == "mine"
    assert "tral fsm states" in machine.description
    assert all(state.label for state in machine.states)


def test_a_new_machine_replaces_a_file_only_by_force() -> None:
    Path("mine.json").write_text("all my work")
    result = tral("new", "mine")
    assert result.exit_code == 2
    assert "mine.json: is there already" in flat(result.stderr)
    assert Path("mine.json").read_text() == "all my work"
    assert tral("new", "mine", "--force").exit_code == 0
    assert load_machine("mine.json").name == "mine"


@pytest.mark.parametrize("policy", ["mine.json", "mine.uxf"])
def test_a_new_machine_drives(policy: str) -> None:
    tral("new", policy)
    arguments = ["drive", "--policy", policy, "--scenario", "straight", "--seed", "3", "--camera", "projected"]
    result = CliRunner().invoke(app, [*arguments, "--no-video", "--json"])
    assert result.exit_code == 0
    assert json.loads(result.stdout)["figures"]["successes"] == 1


def test_the_catalogue_lists_every_type() -> None:
    result = tral("states")
    assert result.exit_code == 0
    assert all(name in result.stdout for name in [*STATES, *CONDITIONS])


def test_the_catalogue_as_json_has_every_parameter() -> None:
    report: dict[str, Any] = json.loads(tral("states", "--json").stdout)
    for kind, known in (("states", STATES), ("conditions", CONDITIONS)):
        assert [entry["type"] for entry in report[kind]] == list(known)
        for entry in report[kind]:
            names = [name for name in known[entry["type"]].model_fields if name not in ("type", "id")]
            assert [parameter["name"] for parameter in entry["parameters"]] == names


def test_one_type_in_detail_whatever_its_case() -> None:
    entry = json.loads(tral("states", "followwallramp", "--json").stdout)["states"][0]
    assert (entry["type"], entry["finishable"], entry["targetable"]) == ("FollowWallRamp", True, True)
    target = next(parameter for parameter in entry["parameters"] if parameter["name"] == "target")
    assert target == {
        "name": "target", "description": "clearance at the end", "unit": "m", "required": False, "default": 0.5,
        "exclusiveMinimum": 0.0, "maximum": 5.0,
    }  # fmt: skip
    shown = flat(tral("states", "FollowWallRamp").stdout)
    assert "It can be handed a target." in shown
    assert "target 0.5 m > 0, ≤ 5 clearance at the end" in shown


def test_a_parameter_without_default_is_called_required() -> None:
    assert "seconds required s" in flat(tral("states", "Timer").stdout)


def test_a_type_without_parameters_says_so() -> None:
    assert "It has no parameters." in tral("states", "Always").stdout
