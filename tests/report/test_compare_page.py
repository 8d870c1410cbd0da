"""The page of a comparison: it stands alone, and each number of the analysis is where it belongs."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import asdict
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from films import film
from lane import Cruiser, Lane
from rich.console import Console

from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Segment
from tral_fsm.evaluation import composite
from tral_fsm.evaluation.effort import Effort
from tral_fsm.evaluation.rollout import drive
from tral_fsm.report.compare import plots
from tral_fsm.report.compare.cells import OVERVIEW, OVERVIEW_UNITS, overview_rows
from tral_fsm.report.compare.clip import FPS, LAST_S, Clip
from tral_fsm.report.compare.markdown import markdown
from tral_fsm.report.compare.page import heat, page_html
from tral_fsm.report.compare.table import table

PLAN = build_plan(Course(name="short", segments=(Segment(length=5.0, width=2.0),)))
PLANS = {("straight", "none", 500): PLAN}
MADE: dict[str, Any] = {
    "training_seed": 7,
    "validation": {"episodes": 50, "time_s": None},
}
MADE |= {"curve": list(range(99))}
EFFORT = Effort(drives=3000, simulated_h=12.5, minutes=1.5, note="by hand first")
PATH = [[1.0 + 0.1 * k, 0.0, 0.0] for k in range(30)]


def about(value: float) -> dict[str, float]:
    return {"value": value, "low": value - 0.05, "high": value + 0.05}


def contender(name: str, success: float, *, truth: bool = False, agents: int = 1) -> dict[str, Any]:
    agent = {
        "source": name, "kind": "machine", "digest": "0123", "sees_truth": truth, "provenance": MADE,
        "effort": None if truth else asdict(EFFORT), "decision_hz": 80.0,
    }  # fmt: skip
    figures = {
        "drives": 40, "success": about(success), "score": about(0.8), "iqm": about(0.85), "gap": about(0.2),
        "progress": about(0.9), "collision_rate": 0.1, "crash_rate": 0.05, "missed_gate_rate": 0.0,
        "timeout_rate": 0.9 - success, "gates_passed": 3, "gates_total": 4, "gate_offset_rms_m": 0.043,
        "settled_rmse_m": None, "time_s": about(21.5), "pace_mps": 0.7, "mean_speed_mps": 0.71, "steering_per_m": 4.2,
        "agent_scores": [0.8] * agents,
    }  # fmt: skip
    return {"name": name, "agents": [agent] * agents, "figures": figures}


def shown(**changes: Any) -> dict[str, Any]:
    names = ("wall", "<b>ppo</b>", "pursuit")
    cell = {"successes": 36, "drives": 40, "low": 0.77, "high": 0.96, "score": 0.8}
    pair = {"first": "wall", "second": "pursuit", "success": about(-0.25), "score": about(-0.1)}
    return {
        "suite": {
            "name": "tiny", "families": ["straight"], "levels": ["none"], "split": "validation", "seeds": [500, 540],
            "camera": "projected",
        },
        "statistics": {"seed": 3, "resamples": 2000},
        "terms": [{"term": "time limit", "values": ["60 s"]}],
        "budgets": "Whether the budgets are equal is unknown.",
        "contenders": [
            contender(names[0], 0.9),
            contender(names[1], 0.5, agents=2),
            contender(names[2], 0.9, truth=True),
        ],
        "tasks": [{"family": "straight", "level": "none", "contenders": dict.fromkeys(names, cell)}],
        "profiles": {
            "levels": [0.0, 0.5, 1.0],
            "contenders": {name: {"value": [1, 0.5, 0], "low": [1, 0.4, 0], "high": [1, 0.6, 0]} for name in names},
        },
        "pairs": [pair | {"improvement": about(0.5), "time_ratio": {"value": 1.2, "low": None, "high": None}}],
        "paths": [
            {
                "family": "straight", "level": "none", "seed": 500,
                "contenders": {name: {"outcome": "collision", "path": PATH} for name in names},
            }
        ],
        "failures": [
            {
                "contender": "wall", "agent": "wall", "level": "none", "scenario": "straight", "seed": 500,
                "outcome": "collision", "crash": True, "time_s": 3.0, "progress": 0.5, "path": PATH,
            }
        ],
        "runs": [{"cpu": "a CPU", "cores": 2, "system": "Linux", "commit": None, "versions": {"python": "3.11.7"}}] * 2,
        "command": "tral compare --policies wall",
        "seconds": 12.5,
        "cpu_seconds": 20.5,
        **changes,
    }  # fmt: skip


class Page(HTMLParser):
    """Sources of pictures, links, and text of a page; every tag that opens must close."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.alone = True
        self.open: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "img"):
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href"):
                self.sources.append(value or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def html() -> str:
    return page_html(shown(), PLANS)


def test_the_page_stands_alone_and_its_tags_close(html: str) -> None:
    page = Page(html)
    assert page.open == []
    assert len(page.sources) == 5
    assert all(source.startswith("data:image/") for source in page.sources)
    assert "http" not in re.sub(r'src="data:[^"]*"', "", html)


def test_its_pictures_are_pictures(html: str) -> None:
    for source in Page(html).sources:
        kind, _, content = source.partition(";base64,")
        start = base64.b64decode(content)[:60]
        assert start.startswith(b"\x89PNG" if kind == "data:image/png" else b"<?xml")


def test_names_are_text_and_no_markup(html: str) -> None:
    assert "<b>ppo</b>" not in html
    assert "<b>ppo</b>" in Page(html).text


@pytest.mark.parametrize(
    "told",
    [
        "seeds 500 to 539, which are\nvalidation courses",
        "Each agent drives 40 courses.",
        "* pursuit: knows its true pose",
        "<b>ppo</b>: few agents. Percentiles of a bootstrap alone would be too narrow",
        "wallwallby hand first3,000drives12.501.50unknown",
        "Whether the budgets are equal is unknown.",
        "time limit60 s",
        "wall 80 Hz, <b>ppo</b> 80 Hz, pursuit 80 Hz.",
        "took 12.5 s, and 20.5 s of all cores",
        "2000 resamples,\nseed 3",
        "90.077.0 to 96.0",
        "-25.0-30.0 to -20.0",
        "wall: crashstraight, none, seed 500: 3.0 s, 50.0 % of the route",
        "tral compare --policies wall",
        "digest 0123; training seed: 7; validation: episodes 50\n",
        "; mean score 0.8",
    ],
)
def test_the_page_tells(told: str, html: str) -> None:
    assert told in Page(html).text


def test_the_probability_of_improvement_is_a_table_of_both_directions() -> None:
    pair = shown()["pairs"][0] | {"improvement": {"value": 0.7, "low": 0.6, "high": 0.9}}
    text = " ".join(Page(page_html(shown(pairs=[pair]), PLANS)).text.split())
    assert "betterthan wallthan <b>ppo</b>than pursuit wall0.700.60 to 0.90 <b>ppo</b> pursuit0.300.10 to 0.40" in text


def test_a_failure_may_have_a_video() -> None:
    page = page_html(shown(), PLANS, {0: b"a film"})
    (source,) = re.findall(r'<video [^>]*src="([^"]*)"></video>', page)
    assert source == "data:video/mp4;base64,YSBmaWxt"
    assert "<video" not in page_html(shown(), PLANS)


class Grey:
    """A view that gets lighter with each picture."""

    def __init__(self) -> None:
        self.taken = 0

    def render_view(self, view: str, width: int, height: int) -> Any:
        assert view == "chase"
        self.taken += 1
        return np.full((height, width, 3), 4 * self.taken, np.uint8)


def test_a_clip_shows_the_last_seconds_and_holds_the_end(tmp_path: Path) -> None:
    views = Grey()
    clip = Clip(views, time_s=6.0)
    drive(Lane(steps=480), Cruiser(), seed=1, on_step=clip)
    assert views.taken == pytest.approx(LAST_S * FPS, abs=1)
    clip.write(tmp_path / "clip.mp4")
    made = film(tmp_path / "clip.mp4")
    assert len(made.pictures) == views.taken + FPS
    assert made.seconds == pytest.approx(LAST_S + 1.0, abs=0.2)


def test_a_computer_is_told_once(html: str) -> None:
    assert Page(html).text.count("a CPU") == 1


def test_a_network_that_stands_alone_for_its_training_is_told() -> None:
    alone = shown()
    assert "One agent alone" not in Page(page_html(alone, PLANS)).text
    alone["contenders"][0]["agents"][0]["kind"] = "policy file"
    assert "One agent alone stands for wall. Its interval is that of this agent" in Page(page_html(alone, PLANS)).text


def test_drives_of_two_programs_are_told_on_the_page_in_markdown_and_on_the_terminal() -> None:
    told = "These drives were made with 2 versions of the program"
    runs = shown()["runs"]
    both = shown(runs=[runs[0], runs[0] | {"commit": "8e64469"}])
    assert told in Page(page_html(both, PLANS)).text
    assert told in markdown(both)
    assert told in str(table(both).caption)
    assert told not in page_html(shown(), PLANS) + markdown(shown()) + str(table(shown()).caption)


def test_the_numbers_of_the_score_are_those_of_its_code(html: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text = " ".join(Page(html).text.split())
    assert "Outcome is 1 for a success, 0.7 for a timeout, 0.7 for a missed gate, 0.65 for a touch, 0.5 for" in text
    assert "Pace is 1 from 0.6 m/s along the route on and falls to 0.8 at 0.3 m/s." in text
    monkeypatch.setattr(composite, "SLOW_FACTOR", 0.77)
    assert "falls to 0.77 at" in Page(page_html(shown(), PLANS)).text.replace("\n", " ")


def test_a_name_with_dollars_is_no_mathematics() -> None:
    name = r"$\foo$"
    one = [contender(name, 0.5)]
    figures = [
        plots.intervals(one),
        plots.outcomes(one),
        plots.profiles({"levels": [0.0, 1.0], "contenders": {name: {"value": [1, 0], "low": [1, 0], "high": [1, 0]}}}),
        plots.paths(PLAN, {name: {"outcome": "success", "path": PATH}}),
    ]
    for figure in figures:
        drawn = io.BytesIO()
        figure.savefig(drawn, format="svg")
        assert b"</svg>" in drawn.getvalue()


def test_a_figure_without_an_interval_is_shown_alone() -> None:
    none = {"value": 0.5, "low": None, "high": None}
    one = contender("wall", 0.9)
    one["figures"] |= {"score": none, "iqm": none, "progress": none, "time_s": none}
    page = Page(page_html(shown(contenders=[one, *shown()["contenders"][1:]]), PLANS))
    assert "wall190.085.0 to 95.00.5000.50050.010.0" in page.text


def test_the_table_of_the_terminal_holds_in_80_characters() -> None:
    many = [contender("machine of 16", 1.0), contender("ppo", 0.5)]
    for one in many:
        one["figures"] |= {"success": {"value": 1.0, "low": 0.51, "high": 1.0}, "drives": 3600}
    console = Console(width=200, file=io.StringIO())
    assert console.measure(table(shown(contenders=many))).maximum <= 80


def test_a_page_without_failures_says_so() -> None:
    assert "No drive failed." in Page(page_html(shown(failures=[]), PLANS)).text


def test_each_cell_of_the_overview_has_a_heading() -> None:
    rows = overview_rows(shown()["contenders"])
    assert {len(row) for row in rows} == {len(OVERVIEW)} == {len(OVERVIEW_UNITS)}
    cells = dict(zip(OVERVIEW[-6:], rows[0][-6:], strict=True))
    assert cells.pop("time") == ("21.5", "21.4 to 21.6")
    assert cells == {
        name: (text, "")
        for name, text in {
            "gates": "3/4", "gate offset": "4.3", "settled RMSE": "-", "pace": "0.70", "steering": "4.2"
        }.items()
    }  # fmt: skip


def test_markdown_has_a_row_a_contender_a_task_and_a_pair() -> None:
    text = markdown(shown())
    assert "| wall | 1 | 90.0 (85.0 to 95.0) | 0.800 (0.750 to 0.850) |" in text
    assert "| pursuit * | 1 |" in text
    assert "| straight | none | 90.0 | 90.0 | 90.0 |" in text
    assert (
        "| wall | pursuit | -25.0 (-30.0 to -20.0) | -0.100 (-0.150 to -0.050) | 0.500 (0.450 to 0.550) | 1.200 |"
        in text
    )


def test_cells_go_from_red_to_green() -> None:
    assert (heat(0.0), heat(1.0)) == ("hsl(8 62% 78%)", "hsl(120 62% 78%)")


def test_many_contenders_are_told_apart() -> None:
    looks = {tuple(plots.style(k).values()) for k in range(32)}
    assert len(looks) == 32


def test_the_car_is_drawn_where_it_stands() -> None:
    corners = plots.outline(np.array([1.0, 2.0, np.pi / 2]))
    assert np.ptp(corners, axis=0) == pytest.approx([0.2, 0.4])
    assert corners.mean(axis=0) == pytest.approx([1.0, 2.0 + 0.258 / 2])


def test_a_failure_is_shown_around_its_path() -> None:
    (ax,) = plots.failure(PLAN, PATH, "#000000").axes
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    assert left < 1.0 < 3.9 < right
    assert low < 0.0 < high
    assert right - left == pytest.approx(high - low)


def test_no_path_hides_one_below_it() -> None:
    ways = {name: {"outcome": "success", "path": PATH} for name in "abc"}
    (ax,) = plots.paths(PLAN, ways).axes
    assert [line.get_linewidth() for line in ax.lines if line.get_label() in ways] == pytest.approx([4.5, 2.85, 1.2])


def test_the_legend_of_paths_names_contenders_alone() -> None:
    figure = plots.paths(PLAN, shown()["paths"][0]["contenders"])
    assert [text.get_text() for text in figure.legends[0].texts] == ["wall", "<b>ppo</b>", "pursuit"]
