"""A comparison drives every course once, keeps each drive, and goes on where it stopped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from courses import blind

from tral_env.errors import ConfigError
from tral_fsm.evaluation import comparison
from tral_fsm.evaluation.analysis import LAST_POSES, analyse
from tral_fsm.evaluation.comparison import RECORDS, drive_again, drive_field, gate_offset, missing, plans_of
from tral_fsm.evaluation.contenders import Contender, contenders, object_agent, single_policy
from tral_fsm.evaluation.records import Record, held
from tral_fsm.evaluation.suites import Suite
from tral_fsm.formats import write

TINY = Suite(name="tiny", families=("straight",), levels=("none",), split="validation", courses=2)


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> list[Contender]:
    """Two agents of one contender and a floor, all of which crash soon."""
    folder = tmp_path_factory.mktemp("machines")
    for name, steering in (("left", 0.9), ("right", -0.9)):
        (folder / f"{name}.json").write_text(write(blind(steering, 1.0), "json"))
    return contenders(f"circles={folder / 'left.json'}+{folder / 'right.json'},random")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, field: list[Contender]) -> Path:
    out = tmp_path_factory.mktemp("compare")
    drive_field(TINY, field, out)
    return out


def drives(lines: list[Record]) -> list[Record]:
    return [line for line in lines if line["kind"] == "drive"]


def test_every_agent_drives_every_course_once(folder: Path, field: list[Contender]) -> None:
    got = drives(drive_field(TINY, field, folder))
    assert len(got) == 6
    assert {(line["contender"], line["seed"]) for line in got} == {
        (name, seed) for name in ("circles", "random") for seed in (500, 501)
    }
    assert {line["outcome"] for line in got} == {"collision"}


def test_what_stands_is_not_driven_again(folder: Path, field: list[Contender]) -> None:
    before = (folder / RECORDS).read_bytes()
    drive_field(TINY, field, folder)
    assert (folder / RECORDS).read_bytes() == before


def test_a_stopped_comparison_goes_on(tmp_path: Path, folder: Path, field: list[Contender]) -> None:
    whole = (folder / RECORDS).read_text().splitlines(keepends=True)
    (tmp_path / RECORDS).write_text("".join(whole[:3]) + whole[3][:40])
    counted: list[int] = []

    class Bar:
        def __init__(self, total: int) -> None:
            counted.append(total)

        def __enter__(self):  # type: ignore[no-untyped-def]
            return lambda: counted.append(1)

        def __exit__(self, *_: object) -> None:
            pass

    lines = drive_field(TINY, field, tmp_path, progress=Bar)
    assert counted == [4, 1, 1, 1, 1]
    wanted = drives(drive_field(TINY, field, folder))
    assert sorted(map(comparison.key, drives(lines))) == sorted(map(comparison.key, wanted))
    by_key = {comparison.key(line): line for line in wanted}
    assert all(by_key[comparison.key(line)] == line for line in drives(lines))


def test_more_courses_and_more_contenders_are_added(folder: Path, field: list[Contender]) -> None:
    lines = drive_field(TINY, field, folder)
    more = [*field, *contenders("constant")]
    (job,) = missing(TINY.with_courses(3), more, lines)
    assert [(one.contender, one.seed) for one in job.entries] == [
        ("constant", 500), ("constant", 501), ("circles", 502), ("circles", 502), ("random", 502), ("constant", 502)
    ]  # fmt: skip


def test_fewer_courses_look_at_the_first_ones(folder: Path, field: list[Contender]) -> None:
    assert {line["seed"] for line in drives(drive_field(TINY.with_courses(1), field, folder))} == {500}


def test_another_suite_in_the_same_folder_is_refused(folder: Path, field: list[Contender]) -> None:
    with pytest.raises(ConfigError, match="choose another --out"):
        drive_field(replace(TINY, levels=("hard",)), field, folder)


def test_a_contender_that_has_changed_is_refused(folder: Path, field: list[Contender]) -> None:
    changed = [replace(field[0], agents=tuple(replace(one, digest="0") for one in field[0].agents)), field[1]]
    with pytest.raises(ConfigError, match=r"circles: .*left.json.* changed since it was made"):
        drive_field(TINY, changed, folder)


def test_jobs_are_split_among_processes(field: list[Contender]) -> None:
    assert [len(job.entries) for job in missing(TINY, field, [], processes=2)] == [3, 3]


def test_agents_with_many_courses_drive_one_after_the_other(field: list[Contender]) -> None:
    (job,) = missing(TINY.with_courses(130), field, [])
    assert len({entry.agent.source for entry in job.entries[:130]}) == 1
    assert [entry.seed for entry in job.entries[:130]] == list(range(500, 630))


def test_a_failure_is_driven_again_as_it_was(folder: Path, field: list[Contender]) -> None:
    shown = analyse(drive_field(TINY, field, folder), TINY, [one.record() for one in field], resamples=20)
    failure = shown["failures"][0]
    policy = single_policy(next(one for one in field[0].agents if one.source == failure["agent"]), "straight")
    assert policy is not None
    ticks: list[float] = []
    episode = drive_again(failure, TINY, policy, lambda env: lambda tick: ticks.append(tick.info["time_s"]))
    assert (episode.outcome, episode.time_s) == (failure["outcome"], failure["time_s"])
    assert ticks[-1] == failure["time_s"]


def test_a_built_in_contender_has_no_policy_of_its_own(field: list[Contender]) -> None:
    assert single_policy(field[1].agents[0], "straight") is None


def test_other_processes_drive_the_same(tmp_path: Path, folder: Path, field: list[Contender]) -> None:
    got = drives(drive_field(TINY, field, tmp_path, processes=2))
    wanted = {comparison.key(line): line for line in drives(drive_field(TINY, field, folder))}
    assert {comparison.key(line): line for line in got} == wanted


def test_the_first_course_has_whole_paths_and_the_others_the_end_of_failures(
    folder: Path, field: list[Contender]
) -> None:
    for line in drives(drive_field(TINY, field, folder)):
        poses = int(np.ceil(line["time_s"] * 10.0)) + 1
        kept = len(line["path"])
        assert kept == pytest.approx(poses if line["seed"] == 500 else min(poses, LAST_POSES), abs=1)
        assert np.hypot(*np.diff(np.array(line["path"])[:, :2], axis=0).T).max() < 0.2


def test_a_gate_is_passed_left_of_its_middle_by_a_positive_offset() -> None:
    assert gate_offset(np.array([5.0, 1.0, 0.0]), np.array([5.01, 1.2, 0.1])) == pytest.approx(0.2)
    assert gate_offset(np.array([5.0, 1.0, np.pi / 2]), np.array([5.2, 1.0, 1.5])) == pytest.approx(-0.2)


def test_the_plans_are_those_of_all_pictures(folder: Path, field: list[Contender]) -> None:
    shown = analyse(drive_field(TINY, field, folder), TINY, [one.record() for one in field], resamples=20)
    plans = plans_of(shown)
    assert set(plans) == {("straight", "none", 500), ("straight", "none", 501)}
    start = np.array(shown["paths"][0]["contenders"]["circles"]["path"][0][:2])
    assert start == pytest.approx(plans["straight", "none", 500].start[:2], abs=0.05)


class Steers:
    """Drives every car the same way."""

    def __init__(self, steering: float) -> None:
        self._command = steering, 1.0

    def reset(self, n: int = 1) -> None:
        pass

    def reset_rows(self, rows: Any) -> None:
        pass

    def act(self, observation: Any) -> Any:
        return np.tile(self._command, (len(observation), 1))


def test_agents_of_two_contenders_may_have_one_source(tmp_path: Path) -> None:
    two = [
        Contender(name=name, agents=(object_agent("seed 0", Steers(steering), name),))
        for name, steering in (("left", 0.9), ("right", -0.9))
    ]
    ends = {line["contender"]: line["path"][-1] for line in drives(drive_field(TINY.with_courses(1), two, tmp_path))}
    assert ends["left"][1] > 0.1
    assert ends["right"][1] < -0.1


def test_an_object_drives_for_one_agent_in_this_process(tmp_path: Path) -> None:
    policy = Steers(0.9)
    twice = [Contender(name=name, agents=(object_agent(name, policy, "1"),)) for name in "ab"]
    with pytest.raises(ConfigError, match="agents 'a' and 'b' are one object"):
        drive_field(TINY, twice, tmp_path)
    with pytest.raises(ConfigError, match="agent 'a' is an object of this program: expected processes=1"):
        drive_field(TINY, twice[:1], tmp_path, processes=2)


def test_contenders_of_one_name_are_refused(field: list[Contender], tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="two are called 'circles'"):
        drive_field(TINY, [field[0], field[0]], tmp_path)


def test_a_folder_that_another_run_holds_is_refused(field: list[Contender], tmp_path: Path) -> None:
    with held(tmp_path / RECORDS), pytest.raises(ConfigError, match="another run writes into it"):
        drive_field(TINY, field, tmp_path)


def test_fewer_contenders_look_at_their_own_drives(folder: Path, field: list[Contender]) -> None:
    assert {line["contender"] for line in drives(drive_field(TINY, field[1:], folder))} == {"random"}
