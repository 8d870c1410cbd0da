"""`tral compare` from its options to its files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from courses import blind
from typer.testing import CliRunner, Result

from tral_fsm.cli import app
from tral_fsm.evaluation import comparison, suites
from tral_fsm.evaluation.suites import Suite
from tral_fsm.formats import write

TINY = Suite(name="tiny", families=("straight",), levels=("none",), split="validation", courses=1)


def tral(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["compare", *(str(argument) for argument in arguments)])


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out") / "cmp"


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("machine") / "circles.json"
    path.write_text(write(blind(0.9, 1.0), "json"))
    return path


@pytest.fixture(autouse=True)
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(suites, "SUITES", {"tiny": TINY})


@pytest.fixture(scope="module")
def done(out: Path, machine: Path) -> Result:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(suites, "SUITES", {"tiny": TINY})
        return tral("--policies", f"{machine},random", "--suite", "tiny", "--out", out)


def test_it_writes_a_page_tables_figures_and_records(done: Result, out: Path) -> None:
    assert done.exit_code == 0, done.output
    assert {path.name for path in out.iterdir()} == {"compare.html", "compare.md", "compare.json", "records.jsonl"}
    assert f"Page: {out / 'compare.html'}" in done.output
    figures = json.loads((out / "compare.json").read_text())
    assert [one["name"] for one in figures["contenders"]] == ["circles", "random"]
    assert "paths" not in figures
    assert "| circles | 1 | 0.0 (0.0 to 79.3) |" in (out / "compare.md").read_text()
    assert "<h1>Comparison on the suite tiny</h1>" in (out / "compare.html").read_text()


def test_the_table_has_a_row_for_each_contender(done: Result) -> None:
    assert [line.split()[:3] for line in done.output.splitlines() if "0.0 %" in line] == [
        ["circles", "1", "0.0"],
        ["random", "1", "0.0"],
    ]


def test_json_alone_is_printed_and_drives_nothing_twice(done: Result, out: Path, machine: Path) -> None:
    before = (out / "records.jsonl").read_bytes()
    again = tral("--policies", f"{machine},random", "--suite", "tiny", "--out", out, "--json")
    assert json.loads(again.stdout) == json.loads((out / "compare.json").read_text())
    assert (out / "records.jsonl").read_bytes() == before


def test_a_changed_contender_in_the_same_folder_is_bad_usage(done: Result, out: Path, machine: Path) -> None:
    before = machine.read_text()
    machine.write_text(write(blind(-0.9, 1.0), "json"))
    try:
        got = tral("--policies", machine, "--suite", "tiny", "--out", out)
    finally:
        machine.write_text(before)
    assert got.exit_code == 2
    assert "choose another --out" in got.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--suite", "smoke"), "unknown suite 'smoke'"),
        (("--suite", "tiny", "--courses", 201), "expected 1 to 200"),
        (("--suite", "tiny", "--policies", "offise"), "did you mean 'office'"),
    ],
)
def test_bad_usage_is_told_before_anything_drives(arguments: tuple[object, ...], message: str, tmp_path: Path) -> None:
    got = tral(*arguments, "--out", tmp_path / "cmp")
    assert got.exit_code == 2
    assert message in got.output
    assert not (tmp_path / "cmp").exists()


def test_a_stopped_comparison_says_how_it_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(comparison, "drive_field", stop)
    got = tral("--suite", "tiny", "--policies", "random", "--out", tmp_path)
    assert got.exit_code == 130
    assert "the same command goes on" in got.output
