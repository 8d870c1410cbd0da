from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from test_summary import record

from tral_env.course.generate import SCENARIOS
from tral_env.errors import ConfigError, MissingExtraError

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import compare
import report

CALM = report.Settings(policy="wall", camera="projected", randomization="none")


def episode(scenario: str, seed: int, outcome: str = "success") -> dict[str, Any]:
    return {"kind": "episode", "scenario": scenario, "seed": seed, **record(outcome)}


def begun(path: Path, *episodes: dict[str, Any]) -> Path:
    report.append(path, {"kind": "run", "settings": asdict(CALM), "host": report.host()})
    for line in episodes:
        report.append(path, line)
    return path


def test_seeds_are_a_range() -> None:
    assert report.span("1000:1050") == range(1000, 1050)


@pytest.mark.parametrize("text", ["5", "5:5", "a:b", "-1:3"])
def test_other_seeds_are_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="expected FIRST:BEHIND"):
        report.span(text)


def test_families_are_named_or_all() -> None:
    assert report.families("all") == list(SCENARIOS)
    assert report.families("straight,gates") == ["straight", "gates"]
    with pytest.raises(ConfigError, match="did you mean 'gates'"):
        report.families("gats")


def test_a_line_cut_off_in_writing_is_driven_again(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.jsonl", episode("straight", 1))
    with path.open("a") as file:
        file.write(json.dumps(episode("straight", 2))[:20])
    assert set(report.read(path, CALM)) == {("straight", 1)}


def test_a_line_after_one_that_was_cut_off_is_whole(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.jsonl", episode("straight", 1))
    with path.open("a") as file:
        file.write('{"kind": "epi')
    report.append(path, episode("straight", 2))
    assert set(report.read(path, CALM)) == {("straight", 1), ("straight", 2)}


def test_a_file_of_other_settings_is_not_mixed_in(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.jsonl")
    with pytest.raises(ConfigError, match="choose another --out"):
        report.read(path, report.Settings(policy="office", camera="rendered", randomization="hard"))


def test_the_table_has_a_row_a_family_with_its_interval(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.jsonl", *(episode("straight", k, "timeout" if k else "success") for k in range(10)))
    rows = report.markdown(path, CALM).splitlines()
    assert rows[-2].startswith("| straight | 10 | 10 % | 2 to 40 % | 0 (0) | 0 | 9 |")
    assert rows[-1].startswith("| all | 10 |")


def test_seeds_with_a_gap_are_not_told_as_one_stretch(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.jsonl", *(episode("straight", seed) for seed in (0, 1, 2, 7, 10, 11)))
    assert "seeds 0 to 2, 7, 10 to 11" in report.markdown(path, CALM)


def test_a_machine_that_cannot_run_begins_no_file(tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text('{"root": 0, "states": []}')
    settings = {**asdict(CALM), "policy": str(tmp_path / "bad.json"), "scenarios": "straight", "processes": 1}
    with pytest.raises(SystemExit, match="a machine needs at least one"):
        report.main(seeds="3:4", out=tmp_path / "a.jsonl", **settings)
    assert not (tmp_path / "a.jsonl").exists()


def test_what_was_driven_is_not_driven_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.jsonl"
    settings = {**asdict(CALM), "scenarios": "straight", "processes": 1, "out": out}
    report.main(seeds="3:4", **settings)
    assert set(report.read(out, CALM)) == {("straight", 3)}
    before = out.read_text()
    report.main(seeds="3:4", **settings)
    assert out.read_text() == before
    assert "| straight | 1 |" in capsys.readouterr().out


def test_a_missing_learner_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingExtraError, match=r"torch.*pip install 'tral-env\[rl\]'"):
        compare.train("straight", "none", 1, 0)
