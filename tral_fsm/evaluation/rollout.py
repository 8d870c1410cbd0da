"""A policy drives an env: the one loop that drive, report, compare and tune share."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tral_env.interface import Policy
from tral_fsm.evaluation.metrics import clearance_error
from tral_fsm.evaluation.settling import settled_ticks
from tral_fsm.runtime.machine import Transit
from tral_fsm.runtime.policy import MachinePolicy

Array = NDArray[np.float64]
_NONE_WANTED = (math.nan, math.nan)
Outcome = Literal["success", "collision", "missed_gate", "timeout"]


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
    wanted: tuple[float, float] = _NONE_WANTED
    """Wall that a clearance is kept to, +1 left, -1 right, and that clearance [m]; NaN: none."""


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


@dataclass(frozen=True, kw_only=True)
class Result:
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

    @property
    def success(self) -> bool:
        """The goal was reached, all gates passed, nothing touched."""
        return self.outcome == "success"

    def record(self) -> dict[str, Any]:
        """The numbers fit for JSON and for `report.summary.summarize`: what could not be measured is None."""
        return {
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


def _measured(metres: float) -> float | None:
    return None if math.isnan(metres) else round(metres, 5)


@dataclass(frozen=True, kw_only=True)
class Episode(Result):
    """How one drive went, tick by tick."""

    trace: Trace = field(repr=False)


def drive(
    env: gym.Env[Any, Any],
    policy: Policy,
    seed: int,
    options: dict[str, Any] | None = None,
    on_step: Callable[[Tick], None] | None = None,
    *,
    scenario: str = "",
) -> Episode:
    """Let a policy drive one episode. Same env, policy and seed give the same episode, bit for bit.

    Args:
        env: `TralCorridor-v0`, or anything with its info.
        policy: if it has `active_states` they are recorded; if it has `wanted_clearance` the clearance error is
            measured against it.
        seed: seed of the course, the car and the noise.
        options: passed to the env's reset.
        on_step: called after each tick.
        scenario: name of what is driven, for the records.

    Returns:
        The episode with its trace.
    """
    observation, _ = env.reset(seed=seed, options=options)
    policy.reset(1)
    ticks: list[Tick] = []
    fired: list[Transit] = []
    with _watched(policy, fired.append):
        ended = False
        while not ended:
            seen = np.array(observation)
            before = _active_state(policy)
            action = np.asarray(policy.act(seen), np.float32)
            wanted = _wanted_clearance(policy)
            observation, _, terminated, truncated, info = env.step(action)
            tick = Tick(
                index=len(ticks),
                observation=seen,
                state=before if fired else _active_state(policy),
                action=action,
                info=info,
                transits=tuple(fired),
                wanted=wanted or _NONE_WANTED,
            )
            fired.clear()
            ticks.append(tick)
            if on_step is not None:
                on_step(tick)
            ended = bool(terminated or truncated)
    return _episode(seed, scenario, ticks)


@contextlib.contextmanager
def _watched(policy: Policy, watch: Callable[[Transit], None]) -> Iterator[None]:
    """Hear of the transitions of a machine, beside whoever does already."""
    if not isinstance(policy, MachinePolicy):
        yield
        return
    before = policy.trace

    def both(transit: Transit) -> None:
        watch(transit)
        if before is not None:
            before(transit)

    policy.trace = both
    try:
        yield
    finally:
        policy.trace = before


def _active_state(policy: Policy) -> str:
    states = getattr(policy, "active_states", None)
    return str(states[0]) if states else ""


def _wanted_clearance(policy: Policy) -> tuple[float, float] | None:
    wanted = getattr(policy, "wanted_clearance", None)
    if wanted is None:
        return None
    side, metres = np.asarray(wanted, float)[0]
    return float(side), float(metres)


def _episode(seed: int, scenario: str, ticks: list[Tick]) -> Episode:
    trace = _trace(ticks)
    last = ticks[-1].info
    errors = trace.clearance_error[np.isfinite(trace.clearance_error)]
    wanted = np.array([tick.wanted for tick in ticks], float)
    settled = trace.clearance_error[settled_ticks(wanted, trace.clearance_error, trace.speed)]
    return Episode(
        seed=seed,
        scenario=scenario,
        outcome=outcome(last),
        crash=bool(last["crash"]),
        progress=float(last["progress"]),
        time_s=float(last["time_s"]),
        mean_speed=float(np.mean(trace.speed)),
        clearance_rmse=float(np.sqrt(np.mean(errors**2))) if len(errors) else math.nan,
        clearance_samples=len(errors),
        settled_rmse=float(np.sqrt(np.mean(settled**2))) if len(settled) else math.nan,
        settled_samples=len(settled),
        lateral_rms=float(np.sqrt(np.mean(trace.lateral_offset**2))),
        gates_passed=int(last["gates_passed"]),
        gates_total=int(last["gates_total"]),
        trace=trace,
    )


def _trace(ticks: list[Tick]) -> Trace:
    def column(name: str) -> Array:
        return np.array([tick.info[name] for tick in ticks], float)

    def where_told(name: str) -> Array:
        return np.array([tick.info.get(name, math.nan) for tick in ticks], float)

    wanted = np.array([tick.wanted for tick in ticks], float)
    return Trace(
        time=column("time_s"),
        pose=column("pose"),
        speed=column("speed_mps"),
        clearance_error=clearance_error(where_told("clearance_left_m"), where_told("clearance_right_m"), wanted),
        lateral_offset=column("lateral_offset_m"),
        gates_passed=column("gates_passed").astype(np.int64),
        readings=np.array([tick.observation for tick in ticks], float),
        action=np.array([tick.action for tick in ticks], float),
        states=tuple(tick.state for tick in ticks),
        transits=tuple((tick.index, transit) for tick in ticks for transit in tick.transits),
    )


def outcome(info: Mapping[str, Any]) -> Outcome:
    """How an episode ended, from its last info."""
    if info["success"]:
        return "success"
    if info["collision"]:
        return "collision"
    return "missed_gate" if info["missed_gate"] else "timeout"
