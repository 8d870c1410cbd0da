"""A comparison as one HTML file that needs no network: tables, figures and pictures are in it."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from tral_env.course.plan import Plan
from tral_fsm.evaluation import composite
from tral_fsm.report.compare import plots
from tral_fsm.report.compare.cells import (
    OVERVIEW,
    OVERVIEW_UNITS,
    PAIRS,
    overview_rows,
    pair_rows,
    percent,
    programs_note,
)

MAX_TOLD = 120
"""The page leaves out what an agent tells of its making with more letters than these, such as its curve."""
UNKNOWN = "unknown"
"""What the table of efforts says where no file tells a number."""
MAX_FEW_AGENTS = 5
"""With this number of agents or fewer, the page says that they are few."""
_PARTS_OF_SCORE = ("EASY_MPS", "SLOW_MPS", "SLOW_FACTOR", "RESTLESS_PER_M", "RESTLESS_FACTOR")
Plans = Mapping[tuple[str, str, int], Plan]
"""Family, level and seed -> the plan of the course."""


def page_html(shown: Mapping[str, Any], plans: Plans, clips: Mapping[int, bytes] | None = None) -> str:
    """The page as text.

    Args:
        shown: what `evaluation.analysis.analyse` found, with "command" and "seconds".
        plans: the courses of its paths and failures.
        clips: number of a failure -> its mp4 file.
    """
    environment = Environment(
        loader=PackageLoader("tral_fsm.report.compare", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html.j2").render(context(shown, plans, clips or {})) + "\n"


def context(shown: Mapping[str, Any], plans: Plans, clips: Mapping[int, bytes]) -> dict[str, Any]:
    """Content of the template: plain texts, lists of cells, and pictures."""
    contenders, suite = shown["contenders"], shown["suite"]
    names = [one["name"] for one in contenders]
    return {
        "suite": suite,
        "courses": (suite["seeds"][1] - suite["seeds"][0]) * len(suite["families"]) * len(suite["levels"]),
        "contenders": contenders,
        "overview": {"header": OVERVIEW, "units": OVERVIEW_UNITS, "rows": overview_rows(contenders)},
        "truth": [one["name"] for one in contenders if any(agent["sees_truth"] for agent in one["agents"])],
        "alone": [one["name"] for one in contenders if len(one["agents"]) == 1 and _is_trained(one["agents"][0])],
        "few": [one["name"] for one in contenders if 2 <= len(one["agents"]) <= MAX_FEW_AGENTS],
        "composite": _composite(),
        "programs": programs_note(shown["runs"]),
        "effort": _efforts(contenders),
        "budgets": shown["budgets"],
        "names": names,
        "terms": [[(one["term"], ""), *((value, "") for value in one["values"])] for one in shown["terms"]],
        "rates": [(one["name"], _rates(one)) for one in contenders],
        "tasks": [_task(task, names) for task in shown["tasks"]],
        "better": _better(shown["pairs"], names),
        "pairs": {"header": PAIRS, "rows": pair_rows(shown["pairs"])},
        "intervals": svg(plots.intervals(contenders)),
        "outcomes": svg(plots.outcomes(contenders)),
        "profiles": svg(plots.profiles(shown["profiles"])),
        "paths": _paths(shown["paths"], plans),
        "failures": _failures(shown["failures"], plans, names, clips),
        "statistics": shown["statistics"],
        "runs": _runs(shown["runs"]),
        "told": {one["name"]: [_told(agent) for agent in one["agents"]] for one in contenders},
        "command": shown["command"],
        "seconds": shown["seconds"],
        "cpu_seconds": shown["cpu_seconds"],
    }


def _is_trained(agent: Mapping[str, Any]) -> bool:
    """Whether another training could have given another agent."""
    return agent["kind"] not in ("machine", "built-in")


def _composite() -> dict[str, str]:
    """The numbers of the score as texts."""
    numbers = {**composite.OUTCOME_FACTORS, **{name: getattr(composite, name) for name in _PARTS_OF_SCORE}}
    return {name: f"{value:g}" for name, value in numbers.items()}


def _efforts(contenders: Sequence[Mapping[str, Any]]) -> list[list[tuple[str, str]]]:
    """Rows of the table of efforts: one for each agent that somebody prepared."""
    return [
        [
            (one["name"], ""),
            (agent["source"], effort["note"]),
            (_known(effort["drives"] if effort["decisions"] is None else effort["decisions"]), _unit(effort)),
            (_known(effort["simulated_h"]), ""),
            (_known(effort["minutes"]), ""),
            (_known(effort["tried"]), ""),
        ]
        for one in contenders
        for agent in one["agents"]
        if (effort := agent["effort"]) is not None
    ]


def _rates(one: Mapping[str, Any]) -> str:
    """How often the agents of a contender decide."""
    return " and ".join(dict.fromkeys(f"{agent['decision_hz']:g} Hz" for agent in one["agents"]))


def _unit(effort: Mapping[str, Any]) -> str:
    """What an effort counts."""
    counted = [name for name in ("drives", "decisions") if effort[name] is not None]
    return counted[-1] if counted else ""


def _known(value: float | None) -> str:
    """A number, or that it is unknown."""
    return UNKNOWN if value is None else f"{value:,}" if isinstance(value, int) else f"{value:.2f}"


def _told(agent: Mapping[str, Any]) -> str:
    """What an agent tells of its making, as far as it is short; compare.json has all of it."""
    texts = {name: _as_text(value) for name, value in agent["provenance"].items()}
    return "".join(f"; {name.replace('_', ' ')}: {text}" for name, text in texts.items() if len(text) <= MAX_TOLD)


def _as_text(value: Any) -> str:
    if not isinstance(value, Mapping):
        return str(value)
    return ", ".join(f"{name.replace('_', ' ')} {one}" for name, one in value.items() if one is not None)


def _task(task: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """A row of the heat table."""
    cells = []
    for name in names:
        one = task["contenders"][name]
        share = one["successes"] / one["drives"]
        cells.append(
            {
                "text": percent(share),
                "range": f"{percent(one['low'])} to {percent(one['high'])}",
                "told": f"{one['successes']} of {one['drives']} drives, score {one['score']:.3f}",
                "colour": heat(share),
            }
        )
    return {"family": task["family"], "level": task["level"], "cells": cells}


def _better(pairs: Sequence[Mapping[str, Any]], names: Sequence[str]) -> list[dict[str, Any]]:
    """Rows of the table of the probability of improvement: how likely the row's contender is better than each."""
    known: dict[tuple[str, str], tuple[float, float | None, float | None]] = {}
    for pair in pairs:
        got = pair["improvement"]
        value, low, high = got["value"], got["low"], got["high"]
        known[pair["first"], pair["second"]] = value, low, high
        known[pair["second"], pair["first"]] = (
            1 - value,
            None if high is None else 1 - high,
            None if low is None else 1 - low,
        )
    return [
        {"name": name, "cells": [_chance(known[name, other]) if (name, other) in known else None for other in names]}
        for name in names
    ]


def _chance(got: tuple[float, float | None, float | None]) -> dict[str, str]:
    """A cell of that table."""
    value, low, high = got
    between = "" if low is None or high is None else f"{low:.2f} to {high:.2f}"
    return {"text": f"{value:.2f}", "range": between, "colour": heat(value)}


def heat(share: float) -> str:
    """Background of a cell: from red over yellow to green, light enough for black text."""
    hue = 8.0 + 112.0 * share
    return f"hsl({hue:.0f} 62% 78%)"


def _paths(found: Sequence[Mapping[str, Any]], plans: Plans) -> list[dict[str, str]]:
    """A picture for each family, on the first level."""
    shown: dict[str, dict[str, str]] = {}
    for one in found:
        if one["family"] not in shown:
            plan = plans[one["family"], one["level"], one["seed"]]
            shown[one["family"]] = {
                "title": f"{one['family']}, {one['level']}, seed {one['seed']}",
                "src": png(plots.paths(plan, one["contenders"]), dpi=110),
            }
    return list(shown.values())


def _failures(
    found: Sequence[Mapping[str, Any]], plans: Plans, names: Sequence[str], clips: Mapping[int, bytes]
) -> list[dict[str, str]]:
    """A picture for each failure of the gallery, and its video if there is one."""
    return [
        {
            "title": f"{one['contender']}: {_fate(one)}",
            "told": f"{one['scenario']}, {one['level']}, seed {one['seed']}: {one['time_s']:.1f} s, "
            f"{percent(one['progress'])} % of the route",
            "src": png(
                plots.failure(
                    plans[one["scenario"], one["level"], one["seed"]],
                    one["path"],
                    plots.style(names.index(one["contender"]))["color"],
                ),
                dpi=100,
            ),
            "clip": _data(clips[number], "video/mp4") if number in clips else "",
        }
        for number, one in enumerate(found)
    ]


def _fate(one: Mapping[str, Any]) -> str:
    if one["outcome"] == "collision":
        return "crash" if one["crash"] else "touch"
    return str(one["outcome"]).replace("_", " ")


def _runs(hosts: Sequence[Mapping[str, Any]]) -> list[str]:
    """The computers and versions of the runs, each once."""
    texts = [
        f"{host['cpu']}, {host['cores']} cores, {host['system']}; commit {host['commit'] or 'unknown'}; "
        + ", ".join(f"{name} {version}" for name, version in host["versions"].items())
        for host in hosts
    ]
    return list(dict.fromkeys(texts))


def svg(figure: Figure) -> str:
    """A figure as the source of an image."""
    return _source(figure, "svg", "image/svg+xml")


def png(figure: Figure, dpi: int) -> str:
    """A figure as the source of an image, in pixels."""
    return _source(figure, "png", "image/png", dpi=dpi)


def _source(figure: Figure, kind: str, mime: str, **options: Any) -> str:
    content = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else None
    figure.savefig(content, format=kind, metadata=metadata, **options)
    return _data(content.getvalue(), mime)


def _data(content: bytes, mime: str) -> str:
    """A file as the source of an element."""
    return f"data:{mime};base64,{base64.b64encode(content).decode()}"
