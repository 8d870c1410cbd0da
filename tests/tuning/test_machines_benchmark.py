"""The measurement of all reference machines: what it drives and writes, not how well."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from courses import blind

from tral_env.errors import ConfigError, TralError
from tral_fsm.formats import write

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import machines


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Machines that hit a wall within two seconds: cheap to drive."""
    for name in {*machines.MACHINES.values(), "office"}:
        (tmp_path / f"{name}.json").write_text(write(blind(0.5, 1.0), "json"))
    return tmp_path


def settings(folder: Path) -> machines.MachinesSettings:
    return machines.MachinesSettings(folder=str(folder), camera="projected", randomization="none")


def straight(seeds: int) -> dict[str, list[tuple[str, int]]]:
    return machines.jobs(["straight"], range(seeds), own=False)


def test_each_family_has_its_machine_and_office_if_asked() -> None:
    assert machines.jobs(["loop", "office"], range(4, 5), own=False) == {
        "loop": [("loop", 4), ("office", 4)],
        "office": [("office", 4)],
    }
    assert machines.jobs(["loop"], range(4, 6), own=True) == {"loop": [("loop", 4), ("loop", 5)]}


def test_a_family_without_a_machine_of_its_own_is_driven_by_office() -> None:
    assert machines.jobs(["slope"], range(2), own=True) == {"slope": [("office", 0), ("office", 1)]}


def test_drives_are_those_of_the_machine_that_is_named(folder: Path) -> None:
    (folder / "office.json").write_text(write(blind(-0.5, 1.0), "json"))
    records = machines.batch("straight", [("wall", 0), ("office", 0), ("wall", 1)], settings(folder))
    assert [(record["machine"], record["seed"]) for record in records] == [("wall", 0), ("office", 0), ("wall", 1)]
    assert records[0]["time_s"] != records[1]["time_s"]


@pytest.mark.slow
def test_what_the_file_holds_is_not_driven_again(folder: Path) -> None:
    out = folder / "out.jsonl"
    machines.drive(straight(1), settings(folder), 1, out)
    machines.drive(straight(2), settings(folder), 1, out)
    drives = machines.drives_of(out)
    assert sorted((each["machine"], each["seed"]) for each in drives) == [
        ("office", 0), ("office", 1), ("wall", 0), ("wall", 1),
    ]  # fmt: skip
    other = machines.MachinesSettings(folder=str(folder), camera="projected", randomization="hard")
    with pytest.raises(ConfigError, match="choose another --out"):
        machines.drive(straight(2), other, 1, out)
    (folder / "loop.json").write_text(write(blind(0.4, 1.0), "json"))
    with pytest.raises(ConfigError, match="loop changed since it was made"):
        machines.drive(straight(3), settings(folder), 1, out)


def test_a_machine_that_is_missing_begins_no_file(folder: Path) -> None:
    (folder / "loop.json").unlink()
    with pytest.raises(TralError, match=r"loop\.json"):
        machines.drive(straight(1), settings(folder), 1, folder / "out.jsonl")
    assert not (folder / "out.jsonl").exists()


def test_the_table_counts_ticks_and_sets_files_beside_each_other(tmp_path: Path) -> None:
    base = {
        "kind": "drive", "machine": "wall", "scenario": "straight", "outcome": "success", "success": True,
        "crash": False, "progress": 1.0, "time_s": 10.0, "mean_speed_mps": 1.0, "settled_samples": 0,
        "settled_rmse_m": None, "lateral_rms_m": 0.1, "gates_passed": 0, "gates_total": 0,
    }  # fmt: skip
    rows = [{"seed": 0, "clearance_rmse_m": 0.02, "clearance_samples": 300},
            {"seed": 1, "clearance_rmse_m": 0.06, "clearance_samples": 100}]  # fmt: skip
    for name, some in (("before", rows), ("now", rows[:1])):
        (tmp_path / f"{name}.jsonl").write_text("".join(json.dumps(base | row) + "\n" for row in some))
    table = machines.markdown([tmp_path / "before.jsonl", tmp_path / "now.jsonl"]).splitlines()
    own = [line for line in table if line.startswith("| straight | wall")]
    assert [line.split(" | ")[2:4] for line in own] == [["before", "2/2"], ["now", "1/1"]]
    assert own[0].split(" | ")[7:9] == ["3.5", "-"]  # sqrt((300 * 2^2 + 100 * 6^2) / 400)
