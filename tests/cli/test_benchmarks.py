from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from courses import drive

from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Gate, Segment
from tral_env.errors import ConfigError
from tral_fsm.evaluation import records

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import compare
import gates
import report
from run_settings import RunSettings

CALM = RunSettings(policy="wall", camera="projected", randomization="none")


def episode(scenario: str, seed: int, outcome: str = "success") -> dict[str, Any]:
    return {
        "kind": "episode",
        **drive(outcome, scenario=scenario, seed=seed, clearance_samples=0, settled_samples=0).record(),
    }


def begun(path: Path, *episodes: dict[str, Any]) -> Path:
    records.begin_run(path, CALM)
    for line in episodes:
        records.append(path, line)
    return path


def test_a_line_cut_off_in_writing_is_driven_again(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.jsonl", episode("straight", 1))
    with path.open("a") as file:
        file.write(json.dumps(episode("straight", 2))[:20])
    assert set(report.read(path, CALM)) == {("straight", 1)}


def test_a_line_after_one_that_was_cut_off_is_whole(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.jsonl", episode("straight", 1))
    with path.open("a") as file:
        file.write('{"kind": "epi')
    records.append(path, episode("straight", 2))
    assert set(report.read(path, CALM)) == {("straight", 1), ("straight", 2)}


def test_a_file_of_other_settings_is_not_mixed_in(tmp_path: Path) -> None:
    path = begun(tmp_path / "a.jsonl")
    with pytest.raises(ConfigError, match="choose another --out"):
        report.read(path, RunSettings(policy="office", camera="rendered", randomization="hard"))


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


def planned(out: Path, agents: int) -> list[str]:
    options = {"suite": "smoke", "courses": 2, "processes": 1, "videos": 0}
    return [" ".join(one) for one in compare.plan("office,random", ["teacher", "ppo"], agents, 10.0, out, **options)]


def test_the_published_comparison_is_one_call(tmp_path: Path) -> None:
    assert planned(tmp_path, agents=0) == [
        f"tral compare --policies office,random --suite smoke --courses 2 --processes 1 --videos 0 --out {tmp_path}"
    ]


def test_search_and_trainings_have_the_same_simulated_time(tmp_path: Path) -> None:
    """10 h are 720,000 decisions at 20 Hz and 360,000 at 10 Hz."""
    search, *trainings, last = planned(tmp_path, agents=2)
    assert search.endswith(f"--budget 1440 --out {tmp_path}/tuned")
    assert 1440 * compare.DRIVE_S == 10.0 * 3600.0
    assert [one.partition("--scenario all ")[2].partition(" --out")[0] for one in trainings] == [
        f"--seed {seed} --steps {steps}" for steps in (720_000, 360_000) for seed in (0, 1)
    ]
    assert f",teacher={tmp_path}/teacher0+{tmp_path}/teacher1,ppo={tmp_path}/ppo0+{tmp_path}/ppo1 " in last
    assert f"office,random,tuned={tmp_path}/tuned/machine.json," in last


def test_what_is_prepared_is_not_prepared_again_and_what_was_begun_goes_on(tmp_path: Path) -> None:
    for name in ("tuned", "teacher0", "teacher1"):
        (tmp_path / name).mkdir()
    (tmp_path / "tuned" / "study.jsonl").touch()
    (tmp_path / "teacher0" / "curve.json").write_text('[{"steps": 9}, {"steps": 720001}]')
    (tmp_path / "teacher1" / "checkpoint.pt").touch()
    search, first, *_ = planned(tmp_path, agents=2)
    assert search.endswith("tuned --resume")
    assert first.endswith("teacher1 --resume")
    (tmp_path / "tuned" / "tune.json").touch()
    assert planned(tmp_path, agents=2)[0] == first


def test_an_unknown_algorithm_is_refused_before_anything_runs(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="unknown algorithm 'pppo': did you mean 'ppo'"):
        compare.main(algos="pppo", agents=1, hours=1.0)
    assert capsys.readouterr().out == ""


def test_a_student_and_the_ppo_that_goes_on_from_it_share_a_budget(tmp_path: Path) -> None:
    options = {"suite": "corners", "courses": None, "processes": 1, "videos": 0, "scenario": "corners", "search": False}
    student, goes_on, other, last = compare.plan("wall", ["teacher_ppo:1", "sac"], 1, 1.0, tmp_path, **options)
    assert " ".join(student[2:]) == (
        f"--algo teacher --scenario corners --seed 0 --plain --steps 36000 --out {tmp_path}/start0"
    )
    assert " ".join(goes_on[2:]) == (
        f"--algo ppo --scenario corners --seed 0 --from {tmp_path}/start0 --steps 36000 --out {tmp_path}/teacher_ppo0"
    )
    assert other[3] == "sac"
    assert f"teacher_ppo={tmp_path}/teacher_ppo0," in " ".join(last)


def test_a_number_of_agents_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigError, match="--algos ppo:x: expected a number of agents"):
        compare.counted(["ppo:x"], 3)


def test_a_command_that_fails_ends_the_script() -> None:
    with pytest.raises(SystemExit) as stopped:
        compare.run(["python", "-c", "raise SystemExit(3)"])
    assert stopped.value.code == 3


ONE_GATE = build_plan(
    Course(name="gate", segments=(Segment(length=10.0, width=2.0, gates=(Gate(id=0, at=5.0, offset=0.1, width=0.8),)),))
)
"""Posts stand 0.4 to 0.64 m to either side of (5, 0.1)."""


def passed(x: float, y: float, yaw: float = 0.0) -> gates.GateWatch:
    """A drive straight along x that ends at a pose, having crossed the gate at its last tick but one."""
    watch = gates.GateWatch(3, ONE_GATE)
    for place in np.arange(3.0, 5.0, 0.02):
        watch.follow(np.array([place, y, yaw]), 0)
    watch.follow(np.array([5.005, y, yaw]), 1)
    watch.follow(np.array([x, y, yaw]), 1)
    return watch


def drive_record(seed: int, outcome: str = "success", y: float = 0.12) -> dict[str, Any]:
    info = {"success": outcome == "success", "collision": outcome == "collision", "missed_gate": False}
    ending = {"pose": np.array([9.0, y, 0.0]), "time_s": 20.0, "progress": 1.0}
    return passed(9.0, y).record(info | ending) | {"seed": seed}


def gates_file(path: Path, *drives: dict[str, Any]) -> Path:
    records.begin_run(path, CALM)
    for line in drives:
        records.append(path, line)
    return path


def test_a_crossing_is_told_where_and_at_what_angle() -> None:
    watch = passed(6.0, 0.15, np.radians(3.0))
    assert watch.crossings == {0: (0.05, 3.0)}
    x, y = np.transpose(watch.paths[0])
    assert x.min() == pytest.approx(-gates.NEAR_M, abs=0.03)
    assert np.all(np.diff(x) > 0.049)
    assert np.all(y == 0.05)


def test_a_post_is_as_far_as_the_nearest_side_of_the_car() -> None:
    car = gates.CarConfig()
    beside = np.array([5.0 - car.middle_x, 0.1, 0.0])
    assert gates.near_post(ONE_GATE, beside) == pytest.approx(0.4 - car.width / 2)
    before = np.array([4.5 - car.middle_x - car.length / 2, 0.1 + 0.52, 0.0])
    assert gates.near_post(ONE_GATE, before) == pytest.approx(0.5 - 0.015)
    turned = np.array([5.0, 0.1 - car.middle_x, np.pi / 2])
    assert gates.near_post(ONE_GATE, turned) == pytest.approx(0.4 - car.length / 2)


@pytest.mark.parametrize(
    ("y", "collision", "contact"), [(0.1 + 0.31, True, True), (0.1 + 0.31, False, False), (-0.85, True, False)]
)
def test_only_a_collision_beside_a_post_is_one_with_it(y: float, collision: bool, contact: bool) -> None:
    pose = np.array([5.0 - gates.CarConfig().middle_x, y, 0.0])
    info = {"success": False, "collision": collision, "missed_gate": False, "time_s": 9.0, "progress": 0.5}
    assert passed(5.1, 0.1).record(info | {"pose": pose})["gate_contact"] is contact


@pytest.mark.parametrize(
    ("true", "told"),
    [
        ({"success"}, "success"),
        ({"collision"}, "collision"),
        ({"collision", "missed_gate"}, "collision"),  # a post is hit in the tick that passes beside it
        ({"missed_gate"}, "missed_gate"),
        (set(), "timeout"),
    ],
)
def test_a_drive_at_gates_ends_as_any_other_drive_does(true: set[str], told: str) -> None:
    info = {name: np.bool_(name in true) for name in ("success", "collision", "missed_gate")}
    ending = {"pose": np.array([9.0, 0.1, 0.0]), "time_s": 9.0, "progress": 0.5}
    assert passed(9.0, 0.1).record(info | ending)["outcome"] == told


def test_the_table_of_gates_has_a_row_a_file_with_its_interval(tmp_path: Path) -> None:
    drives = [drive_record(k, "success" if k else "collision", y=0.12 + 0.01 * k) for k in (0, 1, 2, 8)]
    (row,) = gates.markdown([gates_file(tmp_path / "a.jsonl", *drives)]).splitlines()[2:]
    assert row == "| wall | none | 0 to 2, 8 | 3/4 | 30.1% to 95.4% | 4/4 | 0 | 3.5 / 9.1 | 0.0 / 0.0 | 20 |"


def test_a_file_without_drives_is_no_table(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="no drives in it"):
        gates.main(files=[gates_file(tmp_path / "a.jsonl")], table=True, out=tmp_path / "a.jsonl", **BY_DEFAULT)


BY_DEFAULT: dict[str, Any] = {"camera": "projected", "randomization": "none", "policy": "gate", "processes": 1}


def test_table_and_plot_of_a_file_drive_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, plot = gates_file(tmp_path / "a.jsonl", drive_record(1)), tmp_path / "new" / "a.png"
    before = path.read_text()
    gates.main(files=[path], table=True, plot=plot, **BY_DEFAULT)
    assert "| wall | none | 1 | 1/1 |" in capsys.readouterr().out
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert path.read_text() == before


def test_a_plot_of_no_known_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"unknown suffix '.jpgg'"):
        gates.main(files=[tmp_path / "a.jsonl"], plot=tmp_path / "a.jpgg", **BY_DEFAULT)


def test_drives_of_other_settings_are_not_mixed_in(tmp_path: Path) -> None:
    path = gates_file(tmp_path / "a.jsonl")
    with pytest.raises(SystemExit, match="choose another --out"):
        gates.main(seeds="3:4", out=path, **BY_DEFAULT | {"policy": "gate_scurve"})


def test_a_drive_among_others_is_the_one_alone_and_is_not_driven_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    calm = RunSettings(policy="gate", camera="projected", randomization="none")
    both = gates.batch("gates", [10, 11], calm)
    out = tmp_path / "a.jsonl"
    gates.main(seeds="11:12", out=out, **BY_DEFAULT)
    assert gates.read(out)[1] == [json.loads(json.dumps(both[1]))]
    assert both[1]["outcome"] == "success"
    assert all(gate["passed"] and abs(gate["offset_m"]) < gate["width_m"] / 2 for gate in both[1]["gates"])
    before = out.read_text()
    gates.main(seeds="11:12", out=out, **BY_DEFAULT)
    assert out.read_text() == before
    assert "| gate | none | 11 | 1/1 |" in capsys.readouterr().out
