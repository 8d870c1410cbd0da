"""An episode: the request, its ticks, and its result."""

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
"""Wanted side and clearance of a policy that keeps no clearance."""
Outcome = Literal["success", "collision", "missed_gate", "timeout"]


@dataclass(frozen=True)
class EpisodeRequest:
    """Request for one drive."""

    machine: int
    """Index of the machine."""
    scenario: str
    seed: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Tick:
    """One tick of a drive: the observation, the action, and the truth after it."""

    index: int
    """0 for the first."""
    observation: NDArray[np.floating]
    """(d,) observation of the policy."""
    state: str
    """Name of the state that acted; empty for a policy without states."""
    action: NDArray[np.float32]
    """(2,) steering, throttle."""
    info: Mapping[str, Any]
    """The env's info after the tick."""
    transits: tuple[Transit, ...] = ()
    """Transitions that fired, those of inner machines first."""
    wanted: tuple[float, float] = NO_WISH
    """Side of the followed wall, +1 left, -1 right, and the wanted clearance [m]; NaN: none."""
    clearance_error: float = math.nan
    """True clearance minus the wanted one after the tick, m; NaN where none is wanted or measured."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeTrace:
    """An episode tick by tick: row k holds tick k, with time, pose, speed and clearance error at its end."""

    time: Array
    """(T,) time since reset, s."""
    pose: Array
    """(T, 3) true x, y [m] and yaw [rad] in the course frame."""
    speed: Array
    """(T,) true speed, m/s."""
    clearance_error: Array
    """(T,) m; NaN where no clearance is wanted or measured."""
    lateral_offset: Array
    """(T,) distance from the route, + = left of it, m."""
    gates_passed: NDArray[np.int64]
    """(T,) number of gates passed so far."""
    readings: Array
    """(T, d) observations, in the columns of the env's `Layout`."""
    action: Array
    """(T, 2) steering, throttle."""
    wanted: Array
    """(T, 2) side of the followed wall, +1 left, -1 right, and the wanted clearance [m]; NaN: none."""
    states: tuple[str, ...]
    """(T,) name of the state that acted."""
    transits: tuple[tuple[int, Transit], ...]
    """Tick and record of each transition that fired."""


class TickRecorder:
    """An observer that keeps all ticks."""

    def __init__(self) -> None:
        self.ticks: list[Tick] = []

    def __call__(self, tick: Tick) -> None:
        """Keep a tick."""
        self.ticks.append(tick)

    def trace(self) -> EpisodeTrace:
        """The ticks, column by column."""
        ticks = self.ticks

        def column(name: str) -> Array:
            return np.array([tick.info[name] for tick in ticks], float)

        return EpisodeTrace(
            time=column("time_s"),
            pose=column("pose"),
            speed=column("speed_mps"),
            clearance_error=np.array([tick.clearance_error for tick in ticks], float),
            lateral_offset=column("lateral_offset_m"),
            gates_passed=column("gates_passed").astype(np.int64),
            readings=np.array([tick.observation for tick in ticks], float),
            action=np.array([tick.action for tick in ticks], float),
            wanted=np.array([tick.wanted for tick in ticks], float),
            states=tuple(tick.state for tick in ticks),
            transits=tuple((tick.index, transit) for tick in ticks for transit in tick.transits),
        )


@dataclass(frozen=True, kw_only=True)
class EpisodeResult:
    """Result of one drive, in figures."""

    seed: int
    scenario: str
    outcome: Outcome
    crash: bool
    """Whether the closing speed of the collision makes it a crash, not a touch."""
    progress: float
    """Share of the route, in [0, 1]."""
    time_s: float
    mean_speed: float
    """Mean of the true speed, m/s."""
    clearance_rmse: float
    """Root of the mean square of the clearance error, m; NaN without a measured tick."""
    clearance_samples: int
    """Number of ticks at which the clearance error was measured."""
    settled_rmse: float
    """`clearance_rmse` over the settled ticks alone (see `evaluation.settling`), m; NaN without one."""
    settled_samples: int
    lateral_rms: float
    """Root of the mean square of the distance from the route, m."""
    gates_passed: int
    gates_total: int
    steering_travel: float
    """Sum of the absolute changes of the steering command; from full right to full left is 2."""
    errors: NDArray[np.int64] = field(repr=False, compare=False)
    """(100,) ticks by clearance error, in the bins of `metrics.ERROR_BINS`."""
    route_m: float = math.nan
    """Length of the route, m; NaN if the env does not tell it."""

    @property
    def success(self) -> bool:
        """Whether the car reached the goal, passed all gates and touched nothing."""
        return self.outcome == "success"

    def record(self) -> dict[str, Any]:
        """The result for JSON and for `evaluation.summary.summarize`.

        A figure that was not measured is None. Steering travel and route length are left out if the length is unknown.
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
    """Result of one drive, with its ticks. Episodes are equal if their figures are."""

    trace: EpisodeTrace = field(repr=False, compare=False)


def outcome(info: Mapping[str, Any]) -> Outcome:
    """Outcome of an episode, from its last info."""
    if info["success"]:
        return "success"
    if info["collision"]:
        return "collision"
    return "missed_gate" if info["missed_gate"] else "timeout"
