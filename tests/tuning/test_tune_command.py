"""`tral tune` from its options to its files."""

from __future__ import annotations

import base64
import json
import re
import signal
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from courses import FOLLOW_THEN_CRASH, TWO_WALLS, blind
from typer.testing import CliRunner, Result

from tral_env.course.layout import Course, Segment
from tral_fsm.cli import app
from tral_fsm.cli.tune_show import kept_text
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.effort import of_file
from tral_fsm.evaluation.folder import LOCK
from tral_fsm.formats import write
from tral_fsm.formats.library import load
from tral_fsm.tuning import Progress
from tral_fsm.tuning.classical import experiments
from tral_fsm.tuning.folder import STUDY
from tral_fsm.tuning.search.space import Trial

PARAMS = "0.steering=0.3:0.9,0.speed=0.8:1.6"
CHEAP = ["--seeds", "0:1", "--budget", "4", "--population", "4", "--report-seeds", "500:502", "--processes", "1"]


def tral(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def file_of(machine: MachineDefinition, folder: Path) -> Path:
    path = folder / "mine.json"
    path.write_text(write(machine, "json"))
    return path


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    folder = tmp_path_factory.mktemp("tuned")
    machine = file_of(blind(0.5, 1.0).model_copy(update={"name": "<blind> & bold"}), folder)
    for name in ("new.uxf", "report.html"):
        (folder / name).symlink_to(tmp_path_factory.mktemp("kept") / name)
    arguments = ["--policy", machine, "--params", PARAMS, "--grid", 2, "--save", folder / "new.uxf"]
    return folder, tral("tune", *arguments, *CHEAP, "--out", folder)


def test_it_leaves_a_machine_the_figures_a_report_and_the_study(tuned: tuple[Path, Result]) -> None:
    folder, result = tuned
    assert result.exit_code == 0, result.output
    written = {path.name for path in folder.iterdir()}
    found = {"machine.json", "new.uxf", "new.effort.json", "report.html", "study.jsonl", "tune.json"}
    assert written == found | {LOCK, "mine.json"}
    report = json.loads((folder / "tune.json").read_text())
    assert report["complete"]
    assert report["task"]["seeds"] == [0]
    assert load(folder / "new.uxf").states == load(folder / "machine.json").states


def test_it_leaves_the_effort_beside_each_machine(tuned: tuple[Path, Result]) -> None:
    folder, _ = tuned
    trials = [
        trial for line in (folder / "study.jsonl").read_text().splitlines()[1:] for trial in json.loads(line)["trials"]
    ]
    effort = of_file(folder / "machine.json")
    assert effort.drives == sum(trial["drives"] for trial in trials) > 0
    assert effort.simulated_h == pytest.approx(sum(trial["simulated_s"] for trial in trials) / 3600, abs=1e-3)
    assert effort.minutes is not None
    assert of_file(folder / "new.uxf") == effort


def test_links_stay_links(tuned: tuple[Path, Result]) -> None:
    folder, _ = tuned
    links = [folder / "new.uxf", folder / "report.html"]
    assert all(link.is_symlink() for link in links)
    assert [[path.name for path in link.resolve().parent.iterdir()] for link in links] == [["new.uxf"], ["report.html"]]


def test_it_says_the_verdict(tuned: tuple[Path, Result]) -> None:
    folder, result = tuned
    report = json.loads((folder / "tune.json").read_text())
    assert report["verdict"] in result.stdout
    for row in ("clearance RMSE [cm]", "settled RMSE [cm]", "steering [1/m]", "- failure", "- steering"):
        assert row in result.stdout
    assert "<td>settled RMSE [cm]</td>" in (folder / "report.html").read_text()


def test_the_bar_has_a_line_for_each_stage(tuned: tuple[Path, Result]) -> None:
    for line in (
        r"the machine as it was +\S+ 1/1 drives",
        r"search: (cost [\d.]+ \(was [\d.]+\)|none better than [\d.]+ yet) +\S+ 4/4 drives",
        r"finals on fresh courses +\S+ 10/10 drives",  # the best four and the old machine, two courses
        r"check on held-out drives +\S+ 4/4 drives",
        r"report: cost around the result +\S+ 8/8 drives",  # a plane of 2 x 2 and two lines of 2
    ):
        assert re.search(line, tuned[1].stderr), line


class Tags(HTMLParser):
    """Counts what is opened and closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_report_needs_no_network_and_is_well_formed(tuned: tuple[Path, Result]) -> None:
    html = (tuned[0] / "report.html").read_text()
    tags = Tags()
    tags.feed(html)
    assert tags.open == []
    assert len(tags.sources) >= 4
    for source in tags.sources:
        assert base64.b64decode(source.removeprefix("data:image/png;base64,"))[:4] == b"\x89PNG"
    assert "http" not in re.sub(r'base64,[^"]+', "", html)
    assert "&lt;blind&gt; &amp; bold" in html
    assert "<blind>" not in html


def test_a_course_of_ones_own_is_driven_with_many_cars_and_without_a_word_on_parameters(tmp_path: Path) -> None:
    course, out = tmp_path / "mine.json", tmp_path / "out"
    Course(name="mine", segments=(Segment(length=4.0, width=2.0),)).save(course)
    machine = tmp_path / "machine.json"
    machine.write_text(write(blind(0.5, 1.0), "json"))
    result = tral("tune", "--policy", machine, "--course", course, *CHEAP, "--grid", 0, "--out", out)
    assert result.exit_code == 0, result.output
    assert "Tuning 0.speed (--params chooses others, --list-params lists them)." in result.stderr
    report = json.loads((out / "tune.json").read_text())
    assert report["task"]["course"]["segments"] == [{"length": 4.0}]
    assert report["task"]["scenarios"] == ["mine"]
    assert report["held_out"]["courses"] == 2
    # The study knows the content of the course.
    Course(name="mine", segments=(Segment(length=5.0, width=2.0),)).save(course)
    result = tral("tune", "--policy", machine, "--course", course, *CHEAP, "--grid", 0, "--out", out, "--resume")
    assert (result.exit_code, "the study has task" in result.output) == (2, True)


def test_a_course_file_that_is_none_is_told_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text("{}")
    result = tral("tune", "--course", tmp_path / "bad.json", *CHEAP, "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert "bad.json" in result.output
    assert not (tmp_path / "out").exists()


def test_a_result_that_cannot_be_written_is_said_before_the_search(tmp_path: Path) -> None:
    machine, out = file_of(blind(0.5, 1.0), tmp_path), tmp_path / "out"
    (out / "report.html").mkdir(parents=True)
    result = tral("tune", "--policy", machine, "--params", PARAMS, *CHEAP, "--out", out)
    assert result.exit_code == 2
    assert "report.html in it is a folder" in result.output
    assert [path.name for path in out.iterdir()] == ["report.html"]


def test_the_machine_that_is_tuned_is_not_written_over(tmp_path: Path) -> None:
    machine = file_of(blind(0.5, 1.0), tmp_path).rename(tmp_path / "machine.json")
    text = machine.read_text()
    result = tral("tune", "--policy", machine, "--params", PARAMS, *CHEAP, "--out", tmp_path)
    assert result.exit_code == 2
    assert "would write its result over it: choose another --out" in result.output
    assert machine.read_text() == text


def test_classical_gains_are_printed_without_a_search(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = tral("tune", "--classical", "--policy", file_of(TWO_WALLS, tmp_path))
    assert result.exit_code == 0, result.output
    for shown in ("along", "left", "LQR at 0.7 m/s", "damping"):
        assert shown in result.stdout
    assert not (tmp_path / "runs").exists()


def test_classical_gains_as_json_are_the_only_thing_on_stdout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiments, "relay", lambda speed: None)
    result = tral("tune", "--classical", "--json", "--policy", file_of(TWO_WALLS, tmp_path))
    found = json.loads(result.stdout)
    assert (list(found), found["relay"]) == (["own", "lqr", "relay"], [])
    assert [(each["name"], each["speed"], each["p"], each["d"]) for each in found["own"]] == [
        ("along", 0.7, 1.0, 1.5),
        ("left", 0.7, 3.0, 2.5),
    ]
    assert found["own"][0]["damping"] > 0.0


@pytest.mark.slow
def test_a_step_and_margins_are_shown_for_states_that_follow_a_wall(tmp_path: Path) -> None:
    out = tmp_path / "out"
    machine = file_of(FOLLOW_THEN_CRASH, tmp_path)
    once = ["--budget", 1, "--grid", 0, "--report-seeds", "none"]
    result = tral("tune", "--policy", machine, *CHEAP, *once, "--json", "--out", out)
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["held_out"] is None
    assert [each["label"] for each in report["parameters"]] == ["state[0].p", "state[0].d"]
    html = (out / "report.html").read_text()
    assert "A step of 15 cm in wanted clearance, state follow" in html
    assert "There was no held-out check." in html


HEARS_CTRL_C = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from tral_fsm.cli import app
app()
"""
"""The command, also where whoever runs the tests ignores Ctrl-C, as shells let what they run in the background do."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sent", "code"),
    [(signal.SIGINT, 130), (signal.SIGTERM, 128 + signal.SIGTERM), (signal.SIGHUP, 128 + signal.SIGHUP)],
)
def test_a_signal_ends_it_at_once_and_keeps_what_was_found(tmp_path: Path, sent: signal.Signals, code: int) -> None:
    machine = file_of(blind(0.5, 1.0), tmp_path)
    arguments = ["--policy", machine, "--params", PARAMS, "--seeds", "0:2", "--population", 4, "--processes", 2]
    process = subprocess.Popen(
        [sys.executable, "-c", HEARS_CTRL_C, "tune", *map(str, arguments), "--out", tmp_path],
        stderr=subprocess.PIPE,
        text=True,
    )
    study = tmp_path / STUDY
    while not study.exists() or len(study.read_text().splitlines()) < 3:
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=0.1)
    process.send_signal(sent)
    _, said = process.communicate(timeout=20)
    assert process.returncode == 128 + sent
    assert f"{STUDY} keeps the study: the same command with --resume goes on." in said
    assert "Traceback" not in said
    assert "leaked" not in said
    assert load(tmp_path / "machine.json").states


@pytest.mark.parametrize(
    ("best", "said"),
    [
        (None, "No better machine found yet: out/machine.json is the machine as it was."),
        (3.097, "No better machine found yet: out/machine.json is the machine as it was."),
        (3.0, "out/machine.json is the best machine so far (cost 3.000, was 3.064), without the check on new courses."),
    ],
)
def test_an_interrupted_search_says_which_machine_it_leaves(best: float | None, said: str) -> None:
    progress = None if best is None else Progress(generation=1, drives=8, budget=50, best=trial(best), old=trial(3.064))
    assert kept_text(progress, Path("out"), None).splitlines() == [
        said,
        "out/study.jsonl keeps the study: the same command with --resume goes on.",
    ]
    assert kept_text(progress, Path("out"), "postgresql://me:secret@there/x").splitlines()[1] == (
        "postgresql://me:***@there/x keeps the study: the same command goes on."
    )


def trial(cost: float) -> Trial:
    return Trial(values=(), cost=cost, full=True, drives=8, successes=8, parts=(0.0, 0.0, 0.0, 0.0, 0.0))
