"""An episode: what is asked for, what happens in a tick, and how it went."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tral_fsm.runtime.machine import Transit

Array = NDArray[np.float64]
NO_WISH = (math.nan, math.nan)
"""Side and clearance of a policy that keeps no clearance."""
Outcome = Literal["success", "collision", "missed_gate", "timeout"]


@dataclass(frozen=True)
class EpisodeRequest:
    """One drive that is wanted."""

    machine: int
    """Index of the machine that drives."""
    scenario: str
    seed: int


@dataclass(frozen=True, kw_only=True)
class Tick:
    """One tick of a drive: what the policy saw and answered, and where that led."""

    index: int
    """0 for the first."""
    observation: NDArray[np.floating]
    """(d,) what the policy saw."""
    state: str
    """The state that answered; empty for policies without states."""
    action: NDArray[np.float32]
    """(2,) steering, throttle."""
    info: Mapping[str, Any]
    """The env's info after the tick."""
    transits: tuple[Transit, ...] = ()
    """Transitions that fired, those of inner machines first."""
    wanted: tuple[float, float] = NO_WISH
    """Wall that a clearance is kept to, +1 left, -1 right, and that clearance [m]; NaN: none."""
    clearance_error: float = math.nan
    """True clearance minus the wanted one after the tick, m; NaN where none is wanted or measured."""


@dataclass(frozen=True, kw_only=True)
class Trace:
    """An episode tick by tick: row k is tick k; time, pose, speed and clearance error are those at its end."""

    time: Array
    """(T,) s since reset."""
    pose: Array
    """(T, 3) true x, y [m] and yaw [rad] in the course frame."""
    speed: Array
    """(T,) true speed, m/s."""
    clearance_error: Array
    """(T,) m; NaN where no clearance is wanted or measured."""
    lateral_offset: Array
    """(T,) from the route, + = left of it, m."""
    gates_passed: NDArray[np.int64]
    """(T,)"""
    readings: Array
    """(T, d) what the policy saw, the columns of the env's `Layout`."""
    action: Array
    """(T, 2) steering, throttle."""
    states: tuple[str, ...]
    """(T,) name of the state that answered."""
    transits: tuple[tuple[int, Transit], ...]
    """Each transition that fired, with its tick."""


class Recorder:
    """An observer that keeps every tick."""

    def __init__(self) -> None:
        self.ticks: list[Tick] = []

    def __call__(self, tick: Tick) -> None:
        """Keep a tick."""
        self.ticks.append(tick)

    def trace(self) -> Trace:
        """The ticks, column by column."""
        ticks = self.ticks

        def column(name: str) -> Array:
            return np.array([tick.info[name] for tick in ticks], float)

        return Trace(
            time=column("time_s"),
            pose=column("pose"),
            speed=column("speed_mps"),
            clearance_error=np.array([tick.clearance_error for tick in ticks], float),
            lateral_offset=column("lateral_offset_m"),
            gates_passed=column("gates_passed").astype(np.int64),
            readings=np.array([tick.observation for tick in ticks], float),
            action=np.array([tick.action for tick in ticks], float),
            states=tuple(tick.state for tick in ticks),
            transits=tuple((tick.index, transit) for tick in ticks for transit in tick.transits),
        )


@dataclass(frozen=True, kw_only=True)
class EpisodeResult:
    """How one drive went, in figures."""

    seed: int
    scenario: str
    outcome: Outcome
    crash: bool
    """A collision at a closing speed that counts as a crash, not as a touch."""
    progress: float
    """Share of the route, in [0, 1]."""
    time_s: float
    mean_speed: float
    """Mean of the true speed, m/s."""
    clearance_rmse: float
    """Root of the mean square of the clearance error, m; NaN if there was none to measure."""
    clearance_samples: int
    """Ticks at which there was one."""
    settled_rmse: float
    """The same over the ticks at which the car had arrived at the clearance, see `evaluation.settling`, m; or NaN."""
    settled_samples: int
    lateral_rms: float
    """Root of the mean square of the distance from the route, m."""
    gates_passed: int
    gates_total: int
    steering_travel: float
    """Sum of the changes of the steering command, either way: from full right to full left is 2."""
    errors: NDArray[np.int64] = field(repr=False, compare=False)
    """(100,) ticks by clearance error, in the bins of `metrics.ERROR_BINS`."""
    route_m: float = math.nan
    """Length of the route, m; NaN for an env that does not tell it."""

    @property
    def success(self) -> bool:
        """The goal was reached, all gates passed, nothing touched."""
        return self.outcome == "success"

    def record(self) -> dict[str, Any]:
        """The numbers fit for JSON and for `evaluation.summary.summarize`.

        What could not be measured is None; steering travel stands beside the length of the route, where that is known.
        """
        record = {
            "scenario": self.scenario,
            "seed": self.seed,
            "success": self.success,
            "outcome": self.outcome,
            "crash": self.crash,
            "progress": round(self.progress, 4),
            "time_s": round(self.time_s, 4),
            "mean_speed_mps": round(self.mean_speed, 4),
            "clearance_rmse_m": _measured(self.clearance_rmse),
            "clearance_samples": self.clearance_samples,
            "settled_rmse_m": _measured(self.settled_rmse),
            "settled_samples": self.settled_samples,
            "lateral_rms_m": round(self.lateral_rms, 5),
            "gates_passed": self.gates_passed,
            "gates_total": self.gates_total,
        }
        if math.isnan(self.route_m):
            return record
        return record | {"route_m": round(self.route_m, 3), "steering_travel": round(self.steering_travel, 4)}


def _measured(metres: float) -> float | None:
    return None if math.isnan(metres) else round(metres, 5)


@dataclass(frozen=True, kw_only=True)
class Episode(EpisodeResult):
    """How one drive went, tick by tick."""

    trace: Trace = field(repr=False)


def outcome(info: Mapping[str, Any]) -> Outcome:
    """How an episode ended, from its last info."""
    if info["success"]:
        return "success"
    if info["collision"]:
        return "collision"
    return "missed_gate" if info["missed_gate"] else "timeout"
