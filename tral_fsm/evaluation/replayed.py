"""What comes of a replay, as data: a recorded drive beside its simulation, and beside the answers of a policy."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.recording.read import Recording

Array = NDArray[np.float64]
QUANTITIES: Mapping[str, str] = {
    "ultrasonic_left": "m",
    "ultrasonic_front": "m",
    "ultrasonic_right": "m",
    "speed": "m/s",
    "yaw_rate": "rad/s",
}
"""What a drive and its simulation are compared by, and its unit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """A recorded drive beside the simulated one on the same commands, T ticks."""

    time_s: Array
    """(T,) time since the start, s."""
    recorded: Mapping[str, Array]
    """Quantity -> (T,); NaN where it was not measured, and where an ultrasonic heard no echo."""
    simulated: Mapping[str, Array]
    """The same of the simulated car; NaN after the end of its episode, too."""
    outcome: str
    """How the simulated drive ended before the recorded one; empty: it did not."""

    def residual(self, quantity: str) -> Array:
        """(T,) recorded minus simulated; NaN where one of them is."""
        difference: Array = self.recorded[quantity] - self.simulated[quantity]
        return difference

    def record(self) -> dict[str, Any]:
        """The residuals in figures: root of the mean square, largest, number of ticks; None without a tick."""
        return {name: self._figures(name) for name in QUANTITIES}

    def write_csv(self, path: Path) -> None:
        """Write a row for each tick; a cell is empty where nothing was measured."""
        with path.open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(["time_s", *(f"{what}_{name}" for name in QUANTITIES for what in ("recorded", "simulated"))])
            columns = [side[name] for name in QUANTITIES for side in (self.recorded, self.simulated)]
            for time_s, *numbers in zip(self.time_s, *columns, strict=True):
                rows.writerow([f"{time_s:.4f}", *("" if math.isnan(one) else f"{one:.6f}" for one in numbers)])

    def _figures(self, name: str) -> dict[str, Any]:
        found = self.residual(name)
        found = found[np.isfinite(found)]
        if not len(found):
            return {"rms": None, "largest": None, "ticks": 0}
        return {
            "rms": float(np.sqrt(np.mean(found**2))),
            "largest": float(np.abs(found).max()),
            "ticks": len(found),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenLoop:
    """What a policy would have done in each tick of a recorded drive, T ticks."""

    recording: Recording
    action: Array
    """(T, 2) its steering and throttle."""
    states: tuple[str, ...]
    """(T,) the state that it was in after the tick; empty for a policy without states."""
    drove: bool
    """Whether it is the machine that drove."""

    @property
    def difference(self) -> Array:
        """(T, 2) its answer minus the recorded one."""
        difference: Array = self.action - self.recording.action
        return difference

    def record(self) -> dict[str, Any]:
        """The differences in figures."""
        size = np.abs(self.difference)
        return {
            "ticks": len(size),
            "drove": self.drove,
            **{
                name: {
                    "rms": float(np.sqrt(np.mean(column**2))),
                    "largest": float(column.max()),
                    "different": int(np.count_nonzero(column)),
                }
                for name, column in zip(("steering", "throttle"), size.T, strict=True)
            },
        }

    def write_csv(self, path: Path) -> None:
        """Write a row for each tick."""
        recorded = self.recording
        columns = ("steering", "throttle")
        with path.open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            heads = [f"{what}{name}" for what in ("recorded_", "policy_", "difference_") for name in columns]
            rows.writerow(["tick", "time_s", *heads, "recorded_state", "policy_state"])
            for k, tick in enumerate(recorded.tick.tolist()):
                numbers = (*recorded.action[k], *self.action[k], *self.difference[k])
                texts = [f"{number:.6f}" for number in numbers]
                rows.writerow([tick, f"{recorded.time_s[k]:.4f}", *texts, recorded.states[k], self.states[k]])
