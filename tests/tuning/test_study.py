"""A search from beginning to end: resumed, interrupted, shared, the same whoever drives."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from courses import blind, drive

from tral_env.errors import ConfigError, MissingExtraError
from tral_fsm.conditions.combined import NotSpec
from tral_fsm.conditions.simple import DistanceSpec
from tral_fsm.definition.machine import MachineDefinition, TransitionSpec
from tral_fsm.evaluation.episode import EpisodeRequest
from tral_fsm.evaluation.folder import LOCK
from tral_fsm.evaluation.pool import interrupts_ignored
from tral_fsm.formats.library import load
from tral_fsm.states.basic import MotorSpec
from tral_fsm.tuning import Objective, Progress, Racing, Settings, Stage, Task, Tuned, tune
from tral_fsm.tuning.evaluator import Evaluator
from tral_fsm.tuning.folder import MACHINE, NUMBERS, PAGE, STUDY
from tral_fsm.tuning.found import described
from tral_fsm.tuning.holdout import compare
from tral_fsm.tuning.journal import Journal
from tral_fsm.tuning.parameters import find
from tral_fsm.tuning.study import Study, check_apart

CRASHING = blind(0.5, 1.0)
"""Hits the wall within two seconds, whatever is tuned: cheap to drive."""
PARAMS = ["0.steering=0.3:0.9", "0.speed=0.8:1.6"]
TASK = Task(scenarios=("straight",), seeds=(0, 1))
SETTINGS = Settings(budget=18, population=4, report_seeds=(500, 501), finalists=1, final_seeds=1)


def search(
    out: Path | None, *, resume: bool = False, settings: Settings = SETTINGS, processes: int = 1, stop_at: int = 0
) -> Tuned:
    """A search that is interrupted once it has spent `stop_at` drives."""

    def on_progress(progress: Progress) -> None:
        if stop_at and progress.drives >= stop_at:
            raise KeyboardInterrupt

    return tune(
        CRASHING, PARAMS, TASK, settings=settings, processes=processes, out=out, resume=resume, on_progress=on_progress
    )  # fmt: skip


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Tuned]:
    out = tmp_path_factory.mktemp("whole")
    return out, search(out)


def test_a_search_finds_something_better(whole: tuple[Path, Tuned]) -> None:
    _, tuned = whole
    assert tuned.complete
    assert min(each.cost for each in tuned.trials if each.full) < tuned.old_trial.cost
    assert tuned.finals[0][0] is None  # the old machine drives in the finals too
    assert min(cost for _, cost in tuned.finals) == next(c for v, c in tuned.finals if v == tuned.values)


@pytest.mark.parametrize("budget", [2, 7, 11, 18])
def test_the_budget_is_never_exceeded_and_spent_but_for_less_than_a_candidate_needs(budget: int) -> None:
    shown: list[int] = []
    tuned = tune(
        CRASHING, PARAMS, TASK,
        settings=replace(SETTINGS, budget=budget, report_seeds=()), processes=1,
        on_progress=lambda progress: shown.append(progress.drives),
    )  # fmt: skip
    spent = sum(each.drives for each in tuned.trials)
    assert budget - 2 < spent <= budget
    assert shown[-1] == spent


def test_a_budget_for_less_than_one_candidate_is_refused() -> None:
    with pytest.raises(ConfigError, match="budget = 1: each candidate drives 2 courses: expected 2 or more"):
        search(None, settings=replace(SETTINGS, budget=1))


@pytest.mark.parametrize(("candidates", "drives"), [(0, 0), (1, 4), (2, 5), (3, 9), (4, 10)])
def test_the_drives_of_a_race_are_known_before(candidates: int, drives: int) -> None:
    task = Task(scenarios=("straight",), seeds=(0, 1, 2, 3))
    racing = Racing(share=0.25, keep=0.5)
    assert racing.drives(candidates, task.courses, 1) == drives
    if not candidates:
        return
    with Evaluator(task) as evaluator:
        scored = evaluator.race([CRASHING] * candidates, task.courses, Objective(), racing)
    assert sum(len(each.drives) for each in scored) == drives


def test_the_machine_file_drives_and_says_where_its_numbers_come_from(whole: tuple[Path, Tuned]) -> None:
    out, tuned = whole
    machine = load(out / "machine.json")
    assert machine.states == tuned.new.states
    if tuned.values is not None:
        assert f"state[0].steering = {tuned.values[0]}" in machine.description
        assert "tral-env" in machine.description


def test_it_is_checked_on_other_courses(whole: tuple[Path, Tuned]) -> None:
    tuned = whole[1]
    assert [drive.seed for drive in tuned.new_drives] == [500, 501]
    assert tuned.comparison is not None
    assert json.loads(json.dumps(tuned.record(), allow_nan=False))["held_out"]["verdict"]


@pytest.mark.parametrize("stop_at", [1, 10])
def test_an_interrupted_search_that_is_resumed_is_the_uninterrupted_one(
    stop_at: int, whole: tuple[Path, Tuned], tmp_path: Path
) -> None:
    with pytest.raises(KeyboardInterrupt):
        search(tmp_path, stop_at=stop_at)
    assert load(tmp_path / "machine.json").name == CRASHING.name  # what was found is kept
    again = search(tmp_path, resume=True)
    assert again.trials == whole[1].trials
    assert (again.values, again.finals, again.comparison) == (
        whole[1].values, whole[1].finals, whole[1].comparison,
    )  # fmt: skip
    assert (tmp_path / STUDY).read_bytes() == (whole[0] / STUDY).read_bytes()


def test_half_a_last_line_does_no_harm(whole: tuple[Path, Tuned], tmp_path: Path) -> None:
    text = (whole[0] / STUDY).read_text()
    (tmp_path / STUDY).write_text(text[: len(text) - 40])
    notes: list[str] = []
    settings = {"task": TASK, "settings": SETTINGS, "processes": 1, "out": tmp_path, "resume": True}
    assert tune(CRASHING, PARAMS, **settings, on_note=notes.append).trials == whole[1].trials  # type: ignore[arg-type]
    assert notes == [f"{tmp_path / STUDY}: the last line was cut off: its generation is driven again."]


@pytest.mark.parametrize("sampler", ["cmaes", "random"])
def test_a_larger_budget_goes_on_as_if_it_had_been_there_from_the_start(sampler: Any, tmp_path: Path) -> None:
    if sampler != "cmaes":
        pytest.importorskip("optuna")
    small = replace(SETTINGS, sampler=sampler, budget=9, report_seeds=())  # it cuts the second generation
    large = replace(small, budget=14)
    first = search(tmp_path, settings=small)
    assert first.generations == [4, 2]
    same = search(tmp_path, settings=small, resume=True)
    assert same.trials == first.trials
    assert search(tmp_path, settings=large, resume=True).trials == search(None, settings=large).trials


def test_what_was_asked_differently_is_not_resumed(whole: tuple[Path, Tuned], tmp_path: Path) -> None:
    (tmp_path / STUDY).write_text((whole[0] / STUDY).read_text())
    with pytest.raises(ConfigError, match="the study has sampler"):
        search(tmp_path, resume=True, settings=replace(SETTINGS, seed=1))
    with pytest.raises(ConfigError, match="there is no study to resume"):
        search(tmp_path / "nowhere", resume=True)


@pytest.mark.slow
def test_two_processes_find_what_one_does(whole: tuple[Path, Tuned]) -> None:
    settings = replace(SETTINGS, report_seeds=())
    assert search(None, settings=settings, processes=2).trials == whole[1].trials


@pytest.mark.parametrize("processes", [1, 2])
def test_it_says_what_is_under_way_and_counts_every_drive(processes: int) -> None:
    stages: list[Stage] = []
    settings = replace(SETTINGS, budget=4)
    tuned = tune(CRASHING, PARAMS, TASK, settings=settings, processes=processes, on_stage=stages.append)
    spent = sum(each.drives for each in tuned.trials)
    counts = {
        name: [each.done for each in stages if each.name == name] for name in dict.fromkeys(s.name for s in stages)
    }
    assert list(counts) == ["as it was", "search", "finals", "check"]
    assert all(done == sorted(done) and done[0] == 0 for done in counts.values())
    assert [done[-1] for done in counts.values()] == [2, spent, 2, 4]
    assert [next(each.total for each in stages if each.name == name) for name in counts] == [2, 4, 2, 4]


def test_a_race_drops_the_weaker_half_after_the_first_courses() -> None:
    task = Task(scenarios=("straight",), seeds=(0, 1, 2, 3))
    machines = [blind(steering, 1.0) for steering in (0.9, 0.02, 0.5, 0.01)]
    with Evaluator(task) as evaluator:
        scored = evaluator.race(machines, task.courses, Objective(), Racing(share=0.25, keep=0.5))
    assert [each.full for each in scored] == [False, True, False, True]
    assert [len(each.drives) for each in scored] == [1, 4, 1, 4]
    assert min(scored[0].cost, scored[2].cost) >= max(scored[1].cost, scored[3].cost)


def test_a_race_has_something_of_each_scenario_in_its_first_round() -> None:
    task = Task(scenarios=("straight", "doors", "corners"), seeds=(0, 1))
    first, rest = Racing(share=0.1).rounds(task.courses, 3)
    assert [scenario for scenario, _ in first] == ["straight", "doors", "corners"]
    assert len(rest) == 3
    assert Racing(keep=1.0).rounds(task.courses, 3) == [task.courses]


@pytest.mark.parametrize(
    ("shares", "told"),
    [
        ({"share": 0.0}, "expected a share above 0, at most 1"),
        ({"keep": 1.5}, "expected a share above 0, at most 1"),
        ({"keep": float("nan")}, "keep = nan: expected a finite number"),
        ({"share": "half"}, "share = 'half': expected a finite number"),
    ],
)
def test_a_share_of_a_race_lies_above_0_and_is_1_at_most(shares: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        Racing(**shares)


def test_courses_of_the_report_must_be_new() -> None:
    with pytest.raises(ConfigError, match="seeds 4 to 5 are for tuning and for the report"):
        check_apart(TASK, Settings(report_seeds=(4, 5, 6)))  # finals of seeds 0, 1 have 2 to 5
    with pytest.raises(ConfigError, match="seeds 0, 4 to 5 are for tuning"):
        check_apart(TASK, Settings(report_seeds=(0, 4, 5, 9)))


def test_without_optuna_the_remedy_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(MissingExtraError, match=r"pip install (-e )?'\.\[tune\]'"):
        search(None, settings=replace(SETTINGS, sampler="tpe"))


class TestOptuna:
    """The samplers of the extra."""

    @pytest.fixture(autouse=True)
    def _there(self) -> None:
        pytest.importorskip("optuna")

    @pytest.mark.parametrize("sampler", ["tpe", "random"])
    def test_it_is_resumed_as_cma_is(self, sampler: str, tmp_path: Path) -> None:
        settings = replace(SETTINGS, sampler=sampler, budget=12, report_seeds=())
        uninterrupted = search(None, settings=settings)
        with pytest.raises(KeyboardInterrupt):
            search(tmp_path, settings=settings, stop_at=1)
        assert search(tmp_path, settings=settings, resume=True).trials == uninterrupted.trials

    def test_several_objectives_give_a_front(self) -> None:
        settings = replace(SETTINGS, sampler="nsga2", objectives=("time", "steering"), report_seeds=())
        tuned = search(None, settings=settings)
        assert all(each.full for each in tuned.trials)  # no race
        assert tuned.front


def test_every_machine_drives_every_course() -> None:
    with Evaluator(TASK) as evaluator:
        drives = evaluator.on_courses([CRASHING, blind(-0.5, 1.0)], TASK.courses)
    assert [[each.seed for each in mine] for mine in drives] == [[0, 1], [0, 1]]
    assert drives[0] != drives[1]


def test_the_error_of_a_process_comes_before_the_others_have_driven_to_the_end() -> None:
    stages: list[Stage] = []
    missing = 99
    requests = [EpisodeRequest(k % 2 * missing, "straight", k) for k in range(200)]  # the second process fails at once
    with (
        Evaluator(TASK, processes=2, rows=1, on_stage=stages.append) as evaluator,
        pytest.raises(IndexError),
    ):
        evaluator.drive([CRASHING], requests)
    assert max((stage.done for stage in stages), default=0) < 50


def test_a_result_without_a_whole_trial_can_be_written(whole: tuple[Path, Tuned]) -> None:
    dropped = [replace(each, full=False) for each in whole[1].trials]
    assert replace(whole[1], trials=dropped).record()["best"] is None


def test_a_folder_that_is_not_there_is_made(tmp_path: Path) -> None:
    cheap = replace(SETTINGS, budget=4, report_seeds=())
    tuned = search(tmp_path / "new" / "folder", settings=cheap)
    assert (tmp_path / "new" / "folder" / STUDY).exists()
    assert replace(tuned, values=(0.4, 0.9)).verdict == "There was no held-out check."


def test_a_search_that_found_nothing_says_so_and_not_that_its_gain_is_noise(whole: tuple[Path, Tuned]) -> None:
    nothing = replace(whole[1], values=None)
    assert nothing.verdict == "Nothing better than the machine as it was has been found."
    assert replace(nothing, comparison=None).verdict.endswith("found. There was no held-out check.")


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda lines: [lines[0], '{"tri', *lines[1:]], ":2: the line is damaged"),
        (lambda lines: [lines[0], '{"trials": [{"values": [1]}]}'], ":2: the line is damaged"),
        (lambda lines: ["5", *lines], ":1: the line is damaged"),
        (lambda lines: ['{"header": 5}', *lines], "no study to resume"),
    ],
)
def test_a_damaged_study_is_refused_and_stays_as_it_is(
    whole: tuple[Path, Tuned], tmp_path: Path, damage: Callable[[list[str]], list[str]], said: str
) -> None:
    text = "\n".join(damage((whole[0] / STUDY).read_text().splitlines())) + "\n"
    (tmp_path / STUDY).write_text(text)
    with pytest.raises(ConfigError, match=said):
        search(tmp_path, resume=True)
    assert (tmp_path / STUDY).read_text() == text


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_a_search_that_begins_anew_sets_the_earlier_one_aside_and_says_so(
    whole: tuple[Path, Tuned], tmp_path: Path
) -> None:
    for name in (STUDY, MACHINE):
        (tmp_path / name).write_bytes((whole[0] / name).read_bytes())
    (tmp_path / PAGE).write_text("report of the earlier search")
    notes: list[str] = []
    for _ in range(2):  # nothing is found in between
        Journal(tmp_path, {"machine": "another"}, resume=False, on_note=notes.append)
    assert files(tmp_path) == {STUDY, *(f"before-1/{name}" for name in (STUDY, MACHINE, PAGE))}
    assert (tmp_path / "before-1" / STUDY).read_bytes() == (whole[0] / STUDY).read_bytes()
    assert len((tmp_path / STUDY).read_text().splitlines()) == 1
    assert notes == [f"{tmp_path} holds the results of an earlier search: they are now in {tmp_path / 'before-1'}."]


def test_a_third_search_keeps_both_before_it_apart(tmp_path: Path) -> None:
    for text in ("first", "second"):
        (tmp_path / NUMBERS).write_text(text)
        Journal(tmp_path, {}, resume=False)
    assert [(tmp_path / f"before-{k}" / NUMBERS).read_text() for k in (1, 2)] == ["first", "second"]


def test_a_finished_search_that_goes_on_sets_its_results_aside_and_keeps_its_study(
    whole: tuple[Path, Tuned], tmp_path: Path
) -> None:
    (tmp_path / STUDY).write_bytes((whole[0] / STUDY).read_bytes())
    for name in (NUMBERS, PAGE):
        (tmp_path / name).write_text("of the smaller budget")
    with pytest.raises(KeyboardInterrupt):
        search(tmp_path, resume=True, settings=replace(SETTINGS, budget=22), stop_at=1)
    assert files(tmp_path) == {STUDY, LOCK, MACHINE, f"before-1/{NUMBERS}", f"before-1/{PAGE}"}


def test_a_machine_that_is_no_better_is_never_written(tmp_path: Path) -> None:
    best = blind(0.0, 1.0)  # straight on along a straight corridor
    with pytest.raises(KeyboardInterrupt):
        tune(
            best, ["0.steering=0.7:0.9"], TASK, settings=SETTINGS, processes=1, out=tmp_path, on_progress=interrupted
        )  # fmt: skip
    assert load(tmp_path / MACHINE) == best


def interrupted(progress: Progress) -> None:
    assert not progress.better
    raise KeyboardInterrupt


def test_an_unfinished_machine_says_that_it_is(whole: tuple[Path, Tuned]) -> None:
    tuned = replace(whole[1], values=(0.4, 0.9), comparison=None)
    assert ", not finished" not in described(tuned, "here").description
    assert ", not finished" in described(replace(tuned, complete=False), "here").description


def test_a_machine_that_the_check_finds_worse_is_not_kept(whole: tuple[Path, Tuned]) -> None:
    good, bad = ([drive(seed=k, clearance_rmse=rmse) for k in range(6)] for rmse in (0.02, 0.06))
    new = blind(0.4, 0.9)
    worse = replace(whole[1], values=(0.4, 0.9), new=new, comparison=compare(good, bad, Objective()))
    assert described(worse, "here") == CRASHING
    assert worse.verdict.endswith("The machine as it was is kept.")
    better = replace(worse, comparison=compare(bad, good, Objective()))
    assert described(better, "here").states == new.states


def test_candidates_that_the_definition_does_not_allow_lose_and_do_not_end_the_search() -> None:
    turning = MachineDefinition(
        root=0,
        states=(MotorSpec(id=0, steering=0.5, speed=1.0), MotorSpec(id=1, steering=0.5, speed=1.0, final=True)),
        transitions=(
            TransitionSpec(id=0, source=0, target=1, when=NotSpec(of=(DistanceSpec(distance=0.01),))),
            TransitionSpec(id=1, source=0, target=1, when=DistanceSpec(distance=0.2)),
        ),
    )
    # At 0 m the second way is always open, the first one never.
    (distance,) = find(turning, ["transition[0].of[0].distance=0:1"])
    study = Study(turning, [distance], TASK, Objective(), SETTINGS)
    study.search.ask = lambda: [(0.0,), (0.5,), (0.0,), (0.7,)]  # type: ignore[method-assign]
    study.search.tell = lambda trials: None  # type: ignore[method-assign]
    with Evaluator(TASK) as evaluator:
        trials = study.generation(evaluator)
    assert [each.drives > 0 for each in trials] == [False, True, False, True]
    assert not trials[0].full
    assert trials[0].cost >= max(each.cost for each in trials)


def test_the_description_names_the_last_tuning_alone(whole: tuple[Path, Tuned]) -> None:
    tuned = replace(whole[1], values=(0.4, 0.9))
    once = described(tuned, "first")
    twice = described(replace(tuned, old=once), "second")
    assert twice.description.startswith("Tuned by `second`")
    assert "first" not in twice.description


def test_processes_that_start_do_not_hear_ctrl_c() -> None:
    ask = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))"
    with interrupts_ignored():
        within = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    after = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    assert (within.stdout, after.stdout) == ("True\n", "False\n")
