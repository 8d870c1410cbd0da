"""A recording as a table: one row a tick, for spreadsheets and for programs that read CSV."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tral_env.recording.read import Recording

_COMMANDS = ("action", "applied")
_HEAD = ("tick", "time_s", "clock_s")
_LOOP = ("late_ticks", "lateness_s")
_POLICY = ("state", "wanted_side", "wanted_clearance_m", "transitions")


def write_csv(recording: Recording, path: Path) -> None:
    """Write all ticks; a cell is empty where the tick has no value.

    Args:
        recording: the recording.
        path: the file.
    """
    truth = sorted({name for told in recording.truth for name in told} - {"tick", "time_s"})
    commands = [f"{what}_{name}" for what in _COMMANDS for name in ("steering", "throttle")]
    pulses = ("steering_us", "throttle_us")
    head = [*_HEAD, *recording.layout.names, *commands, *pulses, *_LOOP, *_POLICY, *(f"true_{name}" for name in truth)]
    with path.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(head)
        rows.writerows(_rows(recording, truth))


def _rows(recording: Recording, truth: list[str]) -> Iterator[list[str]]:
    fired: dict[int, list[str]] = {}
    for one in recording.transitions:
        fired.setdefault(one.tick, []).append(str(one.transition))
    for k, tick in enumerate(recording.tick.tolist()):
        numbers = [
            recording.time_s[k], recording.clock_s[k], *recording.observation[k].tolist(),
            *recording.action[k], *recording.applied[k], *recording.pulses_us[k],
            recording.late_ticks[k], recording.lateness_s[k],
        ]  # fmt: skip
        told = recording.truth[k]
        yield [
            str(tick),
            *map(_cell, numbers),
            recording.states[k],
            *map(_cell, recording.wanted[k]),
            " | ".join(fired.get(tick, ())),
            *(_cell(told.get(name)) for name in truth),
        ]


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:.9g}" if isinstance(value, float) else str(value)
