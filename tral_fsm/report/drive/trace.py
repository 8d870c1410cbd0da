"""trace.csv: readings, active state, transitions, their reasons and the true pose in each tick of a drive."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from types import TracebackType
from typing import Self

from tral_env.interface import CORE_LAYOUT, MAX_AGE_S
from tral_fsm.evaluation.episode import Tick

COLUMNS = (
    "tick", "time_s", "state", "transition", "to", "why",
    "left_m", "front_m", "right_m", "distance_m", "speed_mps", "steering", "throttle",
    "wanted_side", "wanted_clearance_m",
    "gate_id", "gate_x_m", "gate_y_m", "gate_heading_rad", "gate_age_s",
    "marker_id", "marker_x_m", "marker_y_m", "marker_heading_rad", "marker_age_s",
    "true_x_m", "true_y_m", "true_yaw_rad", "true_speed_mps",
)  # fmt: skip
"""Header of the table; transitions of one tick share a cell, those of inner machines first.

Readings are those that the policy was given; what is true holds at the end of the tick, in the frame of the course.
"""

_READ = {
    name: CORE_LAYOUT.column(name)
    for name in ("ultrasonic_left", "ultrasonic_front", "ultrasonic_right", "distance", "speed")
}
_DETECTED = {
    what: [CORE_LAYOUT.column(f"{what}_{name}") for name in ("id", "x", "y", "heading", "age")]
    for what in ("gate", "marker")
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
        *_detection(tick, "gate"),
        *_detection(tick, "marker"),
        *(f"{float(number):.4f}" for number in (*tick.info["pose"], tick.info["speed_mps"])),
    ]


def _detection(tick: Tick, what: str) -> list[str]:
    """Id, x, y, heading and age of the last detection; empty where nothing was seen within `MAX_AGE_S`."""
    number, *place, age = (float(tick.observation[column]) for column in _DETECTED[what])
    if age >= MAX_AGE_S:
        return [""] * (len(place) + 2)
    return [f"{number:.0f}", *(f"{value:.4f}" for value in place), f"{age:.4f}"]


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
