"""trace.csv: readings, active state, transitions and their reasons in each tick of a drive."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from types import TracebackType
from typing import Self

from tral_env.interface import CORE_LAYOUT
from tral_fsm.evaluation.episode import Tick

COLUMNS = (
    "tick", "time_s", "state", "transition", "to", "why",
    "left_m", "front_m", "right_m", "distance_m", "speed_mps", "steering", "throttle",
    "wanted_side", "wanted_clearance_m",
)  # fmt: skip
"""Header of the table; transitions of one tick share a cell, those of inner machines first."""

_READ = {
    name: CORE_LAYOUT.column(name)
    for name in ("ultrasonic_left", "ultrasonic_front", "ultrasonic_right", "distance", "speed")
}
_SEPARATOR = " | "


def row(tick: Tick) -> list[str]:
    """A tick as a row of the table.

    Args:
        tick: one tick of a drive.

    Returns:
        One text for each of `COLUMNS`; empty where the tick has no value.
    """
    side, clearance = tick.wanted
    numbers = [*(tick.observation[column] for column in _READ.values()), *tick.action]
    return [
        str(tick.index),
        f"{tick.info['time_s']:.4f}",
        tick.state,
        _SEPARATOR.join(str(t.transition) for t in tick.transits),
        _SEPARATOR.join(str(t.target) for t in tick.transits),
        _SEPARATOR.join(t.why for t in tick.transits),
        *(f"{float(number):.4f}" for number in numbers),
        "" if math.isnan(side) else "left" if side > 0 else "right",
        "" if math.isnan(clearance) else f"{clearance:.4f}",
    ]


class TraceFile:
    """Writes each tick as it ends, so that the file holds all ticks even if the run is killed."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> Self:
        self._file = self.path.open("w", encoding="utf-8", newline="", buffering=1)
        self._rows = csv.writer(self._file, lineterminator="\n")
        self._rows.writerow(COLUMNS)
        return self

    def __call__(self, tick: Tick) -> None:
        """Write a tick; its line is in the file before the next tick."""
        self._rows.writerow(row(tick))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._file.close()
