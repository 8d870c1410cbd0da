"""The tables of a comparison as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tral_fsm.report.compare.cells import (
    OVERVIEW,
    OVERVIEW_UNITS,
    PAIRS,
    Cell,
    overview_rows,
    pair_rows,
    percent,
    programs_note,
)


def markdown(shown: Mapping[str, Any]) -> str:
    """The overview, success by task, and pairs of a comparison (`evaluation.analysis.analyse`)."""
    suite, names = shown["suite"], [one["name"] for one in shown["contenders"]]
    heads = [f"{name} [{unit}]" if unit else name for name, unit in zip(OVERVIEW, OVERVIEW_UNITS, strict=True)]
    return "\n".join(
        [
            f"Suite {suite['name']}: {', '.join(suite['families'])}; {', '.join(suite['levels'])}; "
            f"seeds {suite['seeds'][0]} to {suite['seeds'][1] - 1} ({suite['split']}); camera {suite['camera']}.",
            "",
            *_table(heads, _texts(overview_rows(shown["contenders"]))),
            "",
            "\\* knows what no policy may know.",
            "",
            *_table(["success [%]", "level", *names], [_task_row(task, names) for task in shown["tasks"]], texts=2),
            "",
            *_table(PAIRS, _texts(pair_rows(shown["pairs"])), texts=2),
            "",
            "In brackets: 95 % intervals.",
            *(["", note] if (note := programs_note(shown["runs"])) else []),
            "",
        ]
    )


def _texts(rows: Sequence[Sequence[Cell]]) -> list[list[str]]:
    """Cells with their intervals in brackets."""
    return [[f"{value} ({between})" if between else value for value, between in row] for row in rows]


def _task_row(task: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    cells = [task["contenders"][name] for name in names]
    return [task["family"], task["level"], *(percent(cell["successes"] / cell["drives"]) for cell in cells)]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1) -> list[str]:
    line = "| " + " | ".join(["---"] * texts + ["---:"] * (len(heads) - texts)) + " |"
    return [f"| {' | '.join(heads)} |", line, *(f"| {' | '.join(row)} |" for row in rows)]
