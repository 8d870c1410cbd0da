"""Cells of the tables of a comparison, for the page and for Markdown."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

NOTHING = "-"
Cell = tuple[str, str]
"""A figure and its interval; the interval is empty where there is none."""
OVERVIEW = [
    "contender", "agents", "success", "score", "IQM", "progress", "collisions", "missed gates", "time outs", "gates",
    "gate offset", "settled RMSE", "time", "pace", "steering",
]  # fmt: skip
OVERVIEW_UNITS = ["", "", "%", "", "", "%", "%", "%", "%", "passed/all", "cm", "cm", "s", "m/s", "1/m"]
PAIRS = ["first", "second", "success", "score", "P(first better)", "time ratio"]


def overview_rows(contenders: Sequence[Mapping[str, Any]]) -> list[list[Cell]]:
    """A row for each contender."""
    return [_overview_row(one) for one in contenders]


def _overview_row(one: Mapping[str, Any]) -> list[Cell]:
    got = one["figures"]
    truth = any(agent["sees_truth"] for agent in one["agents"])
    return [
        (one["name"] + (" *" if truth else ""), ""),
        (str(len(one["agents"])), ""),
        _share(got["success"]),
        _number(got["score"]),
        _number(got["iqm"]),
        _share(got["progress"]),
        (percent(got["collision_rate"]), ""),
        (percent(got["missed_gate_rate"]), ""),
        (percent(got["timeout_rate"]), ""),
        (f"{got['gates_passed']}/{got['gates_total']}" if got["gates_total"] else NOTHING, ""),
        (scaled(got["gate_offset_rms_m"], 100.0, 1), ""),
        (scaled(got["settled_rmse_m"], 100.0, 1), ""),
        cell(got["time_s"], 1.0, 1),
        (scaled(got["pace_mps"], 1.0, 2), ""),
        (scaled(got["steering_per_m"], 1.0, 1), ""),
    ]


def pair_rows(pairs: Sequence[Mapping[str, Any]]) -> list[list[Cell]]:
    """A row for each two contenders: first minus second."""
    return [
        [
            (one["first"], ""),
            (one["second"], ""),
            _share(one["success"], sign=True),
            _number(one["score"], sign=True),
            _number(one["improvement"]),
            _number(one["time_ratio"]),
        ]
        for one in pairs
    ]


def programs_note(runs: Sequence[Mapping[str, Any]]) -> str:
    """What to say where the drives were made by several programs; empty where they were not."""
    programs = {json.dumps([run["commit"], run["versions"]], sort_keys=True) for run in runs}
    if len(programs) < 2:
        return ""
    return (
        f"These drives were made with {len(programs)} versions of the program or its packages, which may drive "
        "differently. To compare under one, choose another --out."
    )


def percent(share: float) -> str:
    """A share in percent, without a unit."""
    return f"{100.0 * share:.1f}"


def scaled(value: float | None, factor: float, digits: int) -> str:
    """A number in another unit; nothing where there is none."""
    return NOTHING if value is None else f"{factor * value:.{digits}f}"


def _share(got: Mapping[str, Any], *, sign: bool = False) -> Cell:
    return cell(got, 100.0, 1, sign=sign)


def _number(got: Mapping[str, Any], *, sign: bool = False) -> Cell:
    return cell(got, 1.0, 3, sign=sign)


def cell(got: Mapping[str, Any], factor: float, digits: int, *, sign: bool = False) -> Cell:
    """Value and interval in another unit."""
    plus = "+" if sign else ""
    value, low, high = (
        None if got[name] is None else f"{factor * got[name]:{plus}.{digits}f}" for name in ("value", "low", "high")
    )
    return value or NOTHING, f"{low} to {high}" if low and high else ""
