"""Cells of the tables of a comparison, for the page and for Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

NOTHING = "-"
OVERVIEW = [
    "contender", "agents", "success", "95 %", "score", "95 %", "IQM", "95 %", "progress", "collisions", "missed gates",
    "time outs", "gates", "gate offset", "settled RMSE", "time", "pace", "steering",
]  # fmt: skip
OVERVIEW_UNITS = [
    "", "", "%", "", "", "", "", "", "%", "%", "%", "%", "passed/all", "cm", "cm", "s", "m/s", "1/m",
]  # fmt: skip
PAIRS = ["first", "second", "success", "95 %", "score", "95 %", "P(first better)", "95 %", "time ratio", "95 %"]


def overview_rows(contenders: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """A row for each contender."""
    return [_overview_row(one) for one in contenders]


def _overview_row(one: Mapping[str, Any]) -> list[str]:
    got = one["figures"]
    truth = any(agent["sees_truth"] for agent in one["agents"])
    return [
        one["name"] + (" *" if truth else ""),
        str(len(one["agents"])),
        *_share(got["success"]),
        *_number(got["score"]),
        *_number(got["iqm"]),
        percent(got["progress"]["value"]),
        percent(got["collision_rate"]),
        percent(got["missed_gate_rate"]),
        percent(got["timeout_rate"]),
        f"{got['gates_passed']}/{got['gates_total']}" if got["gates_total"] else NOTHING,
        scaled(got["gate_offset_rms_m"], 100.0, 1),
        scaled(got["settled_rmse_m"], 100.0, 1),
        scaled(got["time_s"]["value"], 1.0, 1),
        scaled(got["pace_mps"], 1.0, 2),
        scaled(got["steering_per_m"], 1.0, 1),
    ]


def pair_rows(pairs: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """A row for each two contenders: first minus second."""
    return [
        [
            one["first"],
            one["second"],
            *_share(one["success"], sign=True),
            *_number(one["score"], sign=True),
            *_number(one["improvement"]),
            *_number(one["time_ratio"]),
        ]
        for one in pairs
    ]


def percent(share: float) -> str:
    """A share in percent, without a unit."""
    return f"{100.0 * share:.1f}"


def scaled(value: float | None, factor: float, digits: int) -> str:
    """A number in another unit; nothing where there is none."""
    return NOTHING if value is None else f"{factor * value:.{digits}f}"


def _share(got: Mapping[str, Any], *, sign: bool = False) -> list[str]:
    return _cells(got, 100.0, 1, sign)


def _number(got: Mapping[str, Any], *, sign: bool = False) -> list[str]:
    return _cells(got, 1.0, 3, sign)


def _cells(got: Mapping[str, Any], factor: float, digits: int, sign: bool) -> list[str]:
    """Value and interval."""
    plus = "+" if sign else ""
    value, low, high = (
        None if got[name] is None else f"{factor * got[name]:{plus}.{digits}f}" for name in ("value", "low", "high")
    )
    return [value or NOTHING, f"{low} to {high}" if low and high else NOTHING]
