"""The report of a search as one HTML file that opens without a network: verdict, figures, pictures, all inside."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape

from matplotlib.figure import Figure

from tral_fsm.evaluation.statistics import Estimate
from tral_fsm.report.tuning import figures as pictures
from tral_fsm.report.tuning import model as tuning_model
from tral_fsm.tuning.classical.design import Gains, lqr, margins
from tral_fsm.tuning.classical.experiments import Response, WallState, relay, step, wall_states
from tral_fsm.tuning.evaluator import Evaluator, OnStage, Stage, Task
from tral_fsm.tuning.found import Tuned
from tral_fsm.tuning.holdout import Comparison
from tral_fsm.tuning.objective import Objective
from tral_fsm.tuning.parameters import Parameter
from tral_fsm.tuning.sensitivity import Sensitivity, sensitivity

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
table { border-collapse: collapse; margin: 0.6rem 0; }
th, td { text-align: right; padding: 0.2rem 0.8rem; border-bottom: 1px solid #ddd; font-variant-numeric: tabular-nums; }
th:first-child, td:first-child { text-align: left; }
img { max-width: 100%; } figure { margin: 0.5rem 0; } figcaption { color: #555; font-size: 0.9rem; }
code { background: #f3f3f3; padding: 0.1rem 0.3rem; overflow-wrap: anywhere; }
.verdict { padding: 0.7rem 1rem; border-left: 5px solid #888; background: #f6f6f6; }
.better { border-color: #2ca02c; } .noise { border-color: #ff9900; } .worse { border-color: #d62728; }
"""
MARGIN_HEADER = (
    "gains", "speed [m/s]", "p [1/m]", "d [s/m]", "phase margin [deg]", "gain margin", "delay margin [ms]", "damping",
)  # fmt: skip
_MOST_LINES = 12
_FEW_COURSES = 4


@dataclass(frozen=True, kw_only=True)
class Page:
    """What the report is about."""

    tuned: Tuned
    task: Task
    objective: Objective
    command: str
    version: str


def report_html(page: Page, *, processes: int = 1, size: int = 9, on_stage: OnStage | None = None) -> str:
    """The report, one file with all its figures.

    Args:
        page: what it is about.
        processes: how many drive the grids.
        size: points along a side of the plane and along a line; 0: neither is driven.
        on_stage: called with what is under way: "around", drives around what was found, then "steps", the responses.
    """
    around = _sensitivity(page, processes, size, on_stage) if size > 1 else None
    body = [_head(page), _checked(page.tuned.comparison), _numbers(page.tuned), *_pictures(page, around)]
    body += _classical(page, on_stage)
    title = escape(f"Tuning of {page.tuned.old.name or 'a machine'}")
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{_STYLE}</style></head>\n<body><h1>{title}</h1>\n" + "\n".join(body) + "\n</body></html>\n"
    )


def _sensitivity(page: Page, processes: int, size: int, on_stage: OnStage | None) -> Sensitivity | None:
    tuned = page.tuned
    values = [each.before for each in tuned.parameters] if tuned.values is None else list(tuned.values)
    real = _order(tuned.parameters)[:_MOST_LINES]
    if not real:
        return None
    with Evaluator(page.task, processes=processes, on_stage=on_stage) as evaluator:
        return sensitivity(
            evaluator,
            tuned.new,
            [tuned.parameters[k] for k in real],
            [values[k] for k in real],
            page.task.courses[: max(_FEW_COURSES, len(page.task.scenarios))],
            page.objective,
            size=size,
        )


def _order(parameters: Sequence[Parameter]) -> list[int]:
    """The real parameters; p and d of one state first, if there are such."""
    real = [k for k, each in enumerate(parameters) if each.kind == "float"]
    places = {(each.sites[0].name, each.sites[0].place[:-1]): k for k, each in enumerate(parameters)}
    for k in real:
        site = parameters[k].sites[0]
        other = places.get(("d", site.place[:-1]))
        if site.name == "p" and other is not None:
            return [k, other, *(each for each in real if each not in (k, other))]
    return real


def _head(page: Page) -> str:
    task = page.task
    seeds = f"{task.seeds[0]} to {task.seeds[-1]}"
    comparison = page.tuned.comparison
    verdict = page.tuned.verdict
    kind = "noise" if comparison is None or comparison.within_noise else "better" if "better" in verdict else "worse"
    return (
        f'<p class="verdict {kind}">{escape(verdict)}</p>\n'
        f"<p>Searched on {escape(', '.join(task.scenarios))}, seeds {seeds}, randomization {task.randomization}: "
        f"{len(page.tuned.trials)} candidates, {sum(each.drives for each in page.tuned.trials)} drives, "
        f"{page.tuned.seconds:.0f} s with finals and check. Drives are pooled by their {page.objective.pooling}.</p>\n"
        f"<p><code>{escape(page.command)}</code><br>tral-env {escape(page.version)}</p>"
    )


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """An HTML table; all is escaped."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    lines = ["<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    return f"<table><tr>{head}</tr>{''.join(lines)}</table>"


def estimate(value: Estimate, scale: float = 1.0, digits: int = 2, sign: str = "") -> str:
    """A figure with its interval."""
    if value.value is None:
        return "-"
    text = f"{scale * value.value:{sign}.{digits}f}"
    if value.low is None or value.high is None:
        return text
    return f"{text} ({scale * value.low:{sign}.{digits}f} to {scale * value.high:{sign}.{digits}f})"


def _checked(found: Comparison | None) -> str:
    if found is None:
        return ""
    old, new = found.old, found.new
    rows = [
        [
            "success [%]", estimate(old.success, 100, 0), estimate(new.success, 100, 0),
            f"{found.only_new} gained, {found.only_old} lost (p = {found.sign_p:.2g})",
        ],
        ["collisions", str(old.collisions), str(new.collisions), ""],
        [
            "clearance RMSE [cm]", estimate(old.clearance_rmse_m, 100), estimate(new.clearance_rmse_m, 100),
            estimate(found.clearance_m, 100, 2, "+"),
        ],
        [
            "settled RMSE [cm]", estimate(old.settled_rmse_m, 100), estimate(new.settled_rmse_m, 100),
            estimate(found.settled_m, 100, 2, "+"),
        ],
        ["time [s/m]", *(estimate(each.time_per_m) for each in (old, new)), estimate(found.time_per_m, 1, 2, "+")],
        ["steering [1/m]", estimate(old.steering_per_m), estimate(new.steering_per_m), ""],
        ["cost", estimate(old.cost), estimate(new.cost), estimate(found.cost, 1, 2, "+")],
    ]  # fmt: skip
    return (
        f"<h2>On {old.drives} courses that nothing was tuned on</h2>"
        + table(["", "was", "now", "paired difference"], rows)
        + "<p>95 % intervals: Wilson's for success, bootstrap over courses for the rest. A difference is taken course "
        "by course, with the same car and noise.</p>"
        "<p>The clearance RMSE holds the way from the start to the clearance. The settled one counts from the first "
        "arrival within 5 cm, or after 4 m: how well a clearance is kept.</p>"
    )


def _numbers(tuned: Tuned) -> str:
    values = tuned.values or (None,) * len(tuned.parameters)
    rows = [
        [pictures.named(each), before(each), before(each) if value is None else _number(value), _range(each)]
        for each, value in zip(tuned.parameters, values, strict=True)
    ]
    finals = [
        ["as it was" if each is None else ", ".join(_number(value) for value in each), f"{cost:.4g}"]
        for each, cost in tuned.finals
    ]
    return (
        "<h2>Numbers</h2>"
        + table(["parameter", "was", "now", "searched"], rows)
        + "<p>Finals, on courses that were new to all of them:</p>"
        + table(["candidate", "cost"], finals)
    )


def before(parameter: Parameter) -> str:
    """What it was, of several sites each value."""
    return ", ".join(dict.fromkeys(_number(site.value) for site in parameter.sites))


def _number(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _range(parameter: Parameter) -> str:
    if parameter.kind == "choice":
        return ", ".join(str(each) for each in parameter.choices)
    return f"{parameter.low:.4g} to {parameter.high:.4g}{', by factors' if parameter.log else ''}"


def picture(figure: Figure, title: str, caption: str) -> str:
    """A section with a picture inside the file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    data = base64.b64encode(buffer.getvalue()).decode()
    return (
        f'<h2>{escape(title)}</h2><figure><img alt="{escape(title)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _pictures(page: Page, around: Sensitivity | None) -> list[str]:
    tuned, shown = page.tuned, []
    if tuned.old_drives:
        shown.append(
            picture(
                pictures.histogram(tuned.old_drives, tuned.new_drives),
                "Clearance on the held-out courses",
                "Every tick on plain straight walls; what is beyond half a metre is counted at the edge.",
            )
        )
    shown.append(
        picture(
            pictures.convergence(tuned.trials, tuned.old_trial),
            "The search",
            "Each dot is a candidate. Who dropped out of its race counts as no better than the weakest that stayed.",
        )
    )
    if around is not None:
        shown += _around(page, around)
    chosen = next((each for each in tuned.trials if each.full and each.values == tuned.values), None)
    if tuned.front:
        shown.append(
            picture(
                pictures.pareto(tuned.trials, tuned.front, tuned.old_trial, chosen, tuned.objectives),
                "What must be traded for what",
                "Candidates whose drives all arrived, on the courses of the search.",
            )
        )
    return shown


def _around(page: Page, around: Sensitivity) -> list[str]:
    tuned, shown = page.tuned, []
    values = dict(zip((each.label for each in tuned.parameters), tuned.values or (), strict=False))
    old = [float(line.parameter.before) for line in around.lines]
    found = [float(values.get(line.parameter.label, was)) for line, was in zip(around.lines, old, strict=True)]
    if around.plane is not None:
        caption = f"{around.plane.cost.size} points, {around.courses} courses each, all other parameters as found."
        shown.append(
            picture(pictures.plane(around.plane, _marks(page, found, old)), "Cost over two parameters", caption)
        )
    caption = (
        f"One parameter at a time, {around.courses} courses. Black: found; dashes: as it was; crosses: drives fail."
    )
    shown.append(picture(pictures.sensitivity(around.lines, found, old), "How much each parameter matters", caption))
    return shown


def _marks(page: Page, found: Sequence[float], old: Sequence[float]) -> dict[str, tuple[float, float]]:
    marks = {"as it was": (old[0], old[1])}
    if page.tuned.values is not None:
        marks["tuned"] = found[0], found[1]
    first, second = (page.tuned.parameters[k].sites[0] for k in _order(page.tuned.parameters)[:2])
    state = next((each for each in wall_states(page.tuned.new) if each.place == first.place[:-1]), None)
    if (first.name, second.name) == ("p", "d") and state is not None:
        gains = lqr(state.speed)
        marks[f"LQR at {state.speed:.3g} m/s"] = (gains.p, gains.d)
        swing = relay(state.speed)
        if swing is not None:
            gains = swing.ziegler_nichols()
            marks["Ziegler-Nichols"] = (gains.p, gains.d)
    return marks


def _classical(page: Page, on_stage: OnStage | None) -> list[str]:
    """The first state that follows a wall, before and after, in the linear model and in the simulation."""
    pairs = list(zip(wall_states(page.tuned.old), wall_states(page.tuned.new), strict=False))
    if not pairs:
        return []
    old, new = next((pair for pair in pairs if pair[0] != pair[1]), pairs[0])
    gains: dict[str, tuple[Gains, float]] = {"was": (old.gains, old.speed), "now": (new.gains, new.speed)}
    gains["LQR"] = (lqr(new.speed), new.speed)
    responses = _responses(gains, on_stage)
    return [
        picture(
            tuning_model.steps(responses),
            f"A step of 15 cm in wanted clearance, state {new.name}",
            "Simulated without randomization (line: mean of 8 cars; band: all), clips off; dashes: linear model.",
        ),
        picture(
            tuning_model.stability(gains),
            "How far from swinging",
            "Linear model: phase margin and damping of the least damped pair of poles. Dots: the machine's own speed.",
        ),
        table(
            MARGIN_HEADER,
            [margin_row(name, WallState(name=name, gains=each, speed=speed)) for name, (each, speed) in gains.items()],
        ),
    ]  # fmt: skip


def _responses(
    gains: dict[str, tuple[Gains, float]], on_stage: OnStage | None
) -> dict[str, tuple[Gains, float, Response]]:
    found: dict[str, tuple[Gains, float, Response]] = {}
    stage = Stage(name="steps", done=0, total=len(gains), unit="responses")
    for name, (each, speed) in gains.items():
        if on_stage is not None:
            on_stage(replace(stage, done=len(found)))
        found[name] = each, speed, step(each, speed)
    if on_stage is not None:
        on_stage(replace(stage, done=len(found)))
    return found


def margin_row(name: str, state: WallState) -> list[str]:
    """Gains and margins as cells."""
    found = margins(state.gains, state.speed)
    return [
        name, f"{state.speed:.3g}", f"{state.gains.p:.3g}", f"{state.gains.d:.3g}", f"{found.phase_deg:.0f}",
        f"{found.gain:.2g}", f"{1000.0 * found.delay_s:.0f}", f"{found.damping:.2f}",
    ]  # fmt: skip
