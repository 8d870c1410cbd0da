"""The page of the benchmark says what the code does."""

from __future__ import annotations

import json
import sys
from dataclasses import fields
from pathlib import Path

import pytest
from pages import read, table

from tral_fsm.evaluation import composite
from tral_fsm.evaluation.baselines import BASELINES
from tral_fsm.evaluation.contenders import ALIASES, SPECIALISTS
from tral_fsm.evaluation.effort import Effort
from tral_fsm.evaluation.suites import SPLITS, SUITES

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import compare

PAGE = read("docs/benchmark.md")


def test_it_names_every_suite_with_its_courses() -> None:
    assert [tuple(row) for row in table(PAGE, "| suite |")] == [
        (one.name, ", ".join(one.families), ", ".join(one.levels), one.split, str(one.courses))
        for one in SUITES.values()
    ]


def test_it_names_the_seeds_of_every_split() -> None:
    shown = {row[0]: row[1] for row in table(PAGE, "| split | seeds |")}
    assert shown == {
        "train": f"{SPLITS['train'].start} and up",
        **{name: f"{SPLITS[name].start} to {SPLITS[name].stop - 1}" for name in ("validation", "test")},
    }


@pytest.mark.parametrize("name", [*BASELINES, *ALIASES, SPECIALISTS])
def test_it_names_every_built_in_contender(name: str) -> None:
    assert f"`{name}`" in [row[0] for row in table(PAGE, "| entry |")]


def test_its_penalties_are_those_of_the_score() -> None:
    shown = {row[0]: row[1] for row in table(PAGE, "| factor |")}
    told = dict(part.rsplit(" ", 1) for part in shown["outcome"].split(", "))
    assert {name.replace(" ", "_"): float(value) for name, value in told.items()} == composite.OUTCOME_FACTORS
    easy, slow = composite.EASY_MPS, composite.SLOW_MPS
    assert shown["pace"] == f"1 from {easy:g} m/s on, linearly down to {composite.SLOW_FACTOR:g} at {slow:g} m/s"
    assert shown["steering"] == (
        f"1 at no effort, linearly down to {composite.RESTLESS_FACTOR:g} at {composite.RESTLESS_PER_M:g} per metre"
    )


def test_it_names_all_that_an_effort_file_may_have() -> None:
    (line,) = [line for line in PAGE.splitlines() if line.startswith('{"tried"')]
    Effort(**json.loads(line))
    for one in fields(Effort):
        assert f"`{one.name}`" in PAGE, one.name


def test_the_hours_of_its_example_are_those_of_the_script() -> None:
    assert round(10 * 3600 / compare.DRIVE_S) == 1440
    assert "so 1440" in PAGE


def test_the_published_table_is_that_of_its_file() -> None:
    shown = json.loads((Path(__file__).parents[2] / "benchmarks/results/contenders.json").read_text())
    overview, families = (table(read("docs/results.md"), head) for head in ("| contender | success", "| family | spec"))
    for row, one in zip(overview, shown["contenders"], strict=True):
        got = one["figures"]
        assert row[0].removesuffix(" \\*") == one["name"]
        assert row[1] == f"{100 * got['success']['value']:.1f}"
        assert row[3:5] == [f"{got['iqm']['value']:.3f}", f"{got['iqm']['low']:.3f} to {got['iqm']['high']:.3f}"]
        assert float(row[8]) == round(got["time_s"]["value"], 1)
    for row in families:
        tasks = [task["contenders"] for task in shown["tasks"] if task["family"] == row[0]]
        for cell, one in zip(row[1:], shown["contenders"], strict=True):
            assert cell == ", ".join(f"{t[one['name']]['successes']}/{t[one['name']]['drives']}" for t in tasks)
