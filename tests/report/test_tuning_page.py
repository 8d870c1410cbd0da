"""The page of a search: each number of hand-made data stands where it belongs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from courses import TWO_WALLS, drive

from tral_fsm.evaluation.episode import EpisodeResult
from tral_fsm.report.tuning.page import context, report_html
from tral_fsm.tuning.classical.design import Gains
from tral_fsm.tuning.classical.loops import Response
from tral_fsm.tuning.found import Tuned
from tral_fsm.tuning.holdout import compare
from tral_fsm.tuning.landscape import CostLine, Sensitivity
from tral_fsm.tuning.objective import PARTS, Objective
from tral_fsm.tuning.page_data import PageData, WallLoops
from tral_fsm.tuning.parameters import find
from tral_fsm.tuning.search.space import Trial

(P,) = find(TWO_WALLS, ["right.p=0.5:2"])
RESPONSE = Response(time=np.arange(2.0), clearance=np.ones((3, 2)), step_m=0.25, randomization="hard")
LINE = CostLine(parameter=P, values=np.array([0.5, 2.0]), cost=np.array([1.0, 2.0]), failed=np.zeros(2))


def trial(cost: float, *values: float, drives: int = 2) -> Trial:
    return Trial(values=values, cost=cost, full=True, drives=drives, successes=drives, parts=(0.0, 0.0, 0.02, 1.0, 2.0))


def driven(rmse: float) -> list[EpisodeResult]:
    return [drive(seed=seed, clearance_rmse=rmse) for seed in range(6)]


def page(old: float = 0.04, new: float = 0.02, **changes: Any) -> PageData:
    tuned = Tuned(
        old=TWO_WALLS,
        new=TWO_WALLS,
        parameters=[P],
        values=(1.25,),
        old_trial=trial(2.0),
        trials=[trial(1.5, 1.0), trial(1.25, 1.25, drives=4)],
        generations=[2],
        finals=[(None, 2.0), ((1.25,), 1.25)],
        old_drives=driven(old),
        new_drives=driven(new),
        comparison=compare(driven(old), driven(new), Objective()),
        seconds=12.4,
    )
    data = PageData(
        tuned=tuned,
        scenarios=("straight", "doors"),
        seeds=(0, 7, 8, 100),
        randomization="default",
        pooling="mean",
        command="tral tune",
        version="1.2.3",
    )
    return replace(data, **changes)


def test_the_head_tells_the_search() -> None:
    told = context(page())
    assert told["title"] == "Tuning of two walls"
    assert (told["scenarios"], told["seeds"]) == ("straight, doors", "0, 7 to 8, 100")
    assert (told["candidates"], told["drives"], told["seconds"]) == (2, 6, "12")


@pytest.mark.parametrize(
    ("old", "new", "verdict"), [(0.04, 0.02, "better"), (0.02, 0.04, "worse"), (0.02, 0.02, "noise")]
)
def test_the_verdict_has_the_colour_of_the_change(old: float, new: float, verdict: str) -> None:
    assert context(page(old, new))["verdict_class"] == verdict


def test_the_check_stands_in_its_table() -> None:
    checked = context(page())["checked"]
    rows = {name: cells for name, *cells in checked["rows"]}
    assert checked["courses"] == 6
    assert checked["header"] == ("", "was", "now", "now - was", "")
    assert rows["collisions"] == ["0", "0", "+0", ""]
    assert rows["clearance RMSE [cm]"] == [
        "4.00 (4.00 to 4.00)",
        "2.00 (2.00 to 2.00)",
        "-2.00 (-2.00 to -2.00)",
        "better",
    ]
    assert rows["- clearance"] == [
        "0.800 (0.800 to 0.800)",
        "0.400 (0.400 to 0.400)",
        "-0.400 (-0.400 to -0.400)",
        "better",
    ]
    assert [name for name in rows if name.startswith("- ")] == [f"- {part}" for part in PARTS]
    assert rows["time [s/m]"][0] == "1.000 (1.000 to 1.000)"


def test_parameters_and_finals_stand_in_their_tables() -> None:
    told = context(page())
    assert told["parameters"] == [["state[right].p [1/m]", "1", "1.25", "0.5 to 2, by factors"]]
    assert told["finals"] == [["as it was", "2"], ["1.25", "1.25"]]


def test_pictures_tell_what_was_driven() -> None:
    loops = WallLoops(state="along", responses={"was": (Gains(p=1.0, d=1.5), 0.7, RESPONSE)})
    around = Sensitivity(plane=None, lines=[LINE], courses=5)
    shown = {each.title: each.caption for each in context(page(loops=loops, sensitivity=around))["pictures"]}
    step = shown["A step of 25 cm in wanted clearance, state along"]
    assert step.startswith("Simulated with randomization 'hard' (line: mean of 3 cars; band: all)")
    assert shown["How much each parameter matters"].startswith("One parameter at a time, 5 courses.")


def test_the_page_holds_the_numbers_as_text() -> None:
    html = report_html(page())
    assert "<td>4.00 (4.00 to 4.00)</td>" in html
    assert 'class="verdict better"' in html
