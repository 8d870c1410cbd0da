"""The report of a search as one HTML file that needs no network: verdict, figures and pictures are in it."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from tral_fsm.evaluation.seeds import stretches
from tral_fsm.report.tuning import model as tuning_model
from tral_fsm.report.tuning import plots
from tral_fsm.tuning.classical.loops import WallGains
from tral_fsm.tuning.found import Tuned
from tral_fsm.tuning.holdout import Change, Comparison
from tral_fsm.tuning.landscape import Sensitivity
from tral_fsm.tuning.page_data import PageData
from tral_fsm.tuning.tables import (
    CHECK_HEADER,
    MARGIN_HEADER,
    before_cell,
    check_rows,
    margin_cells,
    range_cell,
    value_cell,
)


@dataclass(frozen=True, kw_only=True)
class PageFigure:
    """A picture with its title and caption."""

    title: str
    caption: str
    png: str
    """PNG file, base64."""


def report_html(page: PageData) -> str:
    """Report as the text of an HTML file."""
    environment = Environment(
        loader=PackageLoader("tral_fsm.report.tuning", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html.j2").render(context(page)) + "\n"


def context(page: PageData) -> dict[str, Any]:
    """Content of the template: plain texts, lists of cells, and plots."""
    return {
        "title": f"Tuning of {page.tuned.old.name or 'a machine'}",
        **_head(page),
        "checked": _checked(page.tuned.comparison),
        **_numbers(page.tuned),
        "pictures": [*_pictures_of_search(page), *_pictures_of_loops(page)],
        "margins": _margins(page),
    }


def _head(page: PageData) -> dict[str, Any]:
    tuned, comparison = page.tuned, page.tuned.comparison
    return {
        "verdict": tuned.verdict,
        "verdict_class": Change.NOISE if comparison is None else comparison.change,
        "scenarios": ", ".join(page.scenarios),
        "seeds": stretches(page.seeds),
        "randomization": page.randomization,
        "candidates": len(tuned.trials),
        "drives": sum(each.drives for each in tuned.trials),
        "seconds": f"{tuned.seconds:.0f}",
        "pooling": page.pooling,
        "command": page.command,
        "version": page.version,
    }


def _checked(found: Comparison | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {"courses": found.courses, "header": CHECK_HEADER, "rows": check_rows(found)}


def _numbers(tuned: Tuned) -> dict[str, list[list[str]]]:
    values = tuned.values or (None,) * len(tuned.parameters)
    rows = [
        [plots.named(each), before_cell(each), before_cell(each) if value is None else value_cell(value),
         range_cell(each)]
        for each, value in zip(tuned.parameters, values, strict=True)
    ]  # fmt: skip
    finals = [
        ["as it was" if each is None else ", ".join(value_cell(value) for value in each), f"{cost:.4g}"]
        for each, cost in tuned.finals
    ]
    return {"parameters": rows, "finals": finals}


def page_figure(figure: Figure, title: str, caption: str) -> PageFigure:
    """A figure as a picture inside the file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return PageFigure(title=title, caption=caption, png=base64.b64encode(buffer.getvalue()).decode())


def _pictures_of_search(page: PageData) -> list[PageFigure]:
    tuned, shown = page.tuned, []
    if tuned.old_drives:
        shown.append(
            page_figure(
                plots.histogram(tuned.old_drives, tuned.new_drives),
                "Clearance in the held-out drives",
                "Every tick on plain straight walls; what is beyond half a metre is counted at the edge.",
            )
        )
    shown.append(
        page_figure(
            plots.convergence(tuned.trials, tuned.old_trial),
            "The search",
            "Each dot is a candidate. One that dropped out of its race counts as no better than the weakest that "
            "stayed.",
        )
    )
    if page.sensitivity is not None:
        shown += _pictures_of_sensitivity(tuned, page.sensitivity)
    chosen = next((each for each in tuned.trials if each.full and each.values == tuned.values), None)
    if tuned.front:
        shown.append(
            page_figure(
                plots.pareto(tuned.trials, tuned.front, tuned.old_trial, chosen, tuned.objectives),
                "What must be traded for what",
                "Candidates whose drives all arrived, on the courses of the search.",
            )
        )
    return shown


def _pictures_of_sensitivity(tuned: Tuned, around: Sensitivity) -> list[PageFigure]:
    shown = []
    values = dict(zip((each.label for each in tuned.parameters), tuned.values or (), strict=False))
    old = [float(line.parameter.before) for line in around.lines]
    found = [float(values.get(line.parameter.label, was)) for line, was in zip(around.lines, old, strict=True)]
    if around.plane is not None:
        marks = _marks(tuned, found, old) | around.landmarks
        caption = f"{around.plane.cost.size} points, {around.courses} courses each, all other parameters as found."
        shown.append(page_figure(plots.plane(around.plane, marks), "Cost over two parameters", caption))
    caption = (
        f"One parameter at a time, {around.courses} courses. Black: found; dashes: as it was; crosses: drives fail."
    )
    shown.append(page_figure(plots.sensitivity(around.lines, found, old), "How much each parameter matters", caption))
    return shown


def _marks(tuned: Tuned, found: Sequence[float], old: Sequence[float]) -> dict[str, tuple[float, float]]:
    marks = {"as it was": (old[0], old[1])}
    if tuned.values is not None:
        marks["tuned"] = found[0], found[1]
    return marks


def _pictures_of_loops(page: PageData) -> list[PageFigure]:
    """Pictures of a wall following state before and after, in the linear model and in the simulation."""
    if page.loops is None:
        return []
    _, _, response = next(iter(page.loops.responses.values()))
    return [
        page_figure(
            tuning_model.steps(page.loops.responses),
            f"A step of {100 * response.step_m:.3g} cm in wanted clearance, state {page.loops.state}",
            f"Simulated with randomization {response.randomization!r} (line: mean of {len(response.clearance)} cars; "
            "band: all), clips off; dashes: linear model.",
        ),
        page_figure(
            tuning_model.stability(page.loops.gains),
            "How far from swinging",
            "Linear model: phase margin and damping of the least damped pair of poles. Dots: the machine's own speed.",
        ),
    ]


def _margins(page: PageData) -> dict[str, Any] | None:
    if page.loops is None:
        return None
    states = [WallGains(name=name, gains=gains, speed=speed) for name, (gains, speed) in page.loops.gains.items()]
    return {"header": MARGIN_HEADER, "rows": [margin_cells(state) for state in states]}
