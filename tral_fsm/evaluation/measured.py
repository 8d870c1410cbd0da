"""Drives of a real car, as far as the car itself measured them."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import CORE_LAYOUT
from tral_env.recording.read import Recording
from tral_fsm.estimation.odometry import Odometry
from tral_fsm.estimation.readings import Readings
from tral_fsm.evaluation.episode import EpisodeTrace, Tick
from tral_fsm.runtime.machine import Transit

Array = NDArray[np.float64]


def dead_reckoning(recording: Recording) -> Array:
    """(T, 3) x, y [m] and yaw [rad] by the hall sensor and the steering alone; the drive begins at 0, 0, 0."""
    odometry, poses = Odometry(), []
    for row in recording.observation[:, : CORE_LAYOUT.size].tolist():
        odometry.update(Readings(*row), 0.0, 1.0)
        poses.append((odometry.x, odometry.y, odometry.yaw))
    return np.array(poses, float).reshape(-1, 3)


def measured_trace(recording: Recording) -> EpisodeTrace:
    """A drive tick by tick; the pose is dead reckoning, and what a car cannot measure is NaN."""
    ticks = len(recording.tick)
    unknown, row_of = np.full(ticks, np.nan), {tick: row for row, tick in enumerate(recording.tick.tolist())}
    readings = recording.observation.astype(float)
    return EpisodeTrace(
        time=recording.time_s,
        pose=dead_reckoning(recording),
        speed=readings[:, CORE_LAYOUT.column("speed")],
        clearance_error=unknown,
        lateral_offset=unknown,
        gates_passed=np.zeros(ticks, np.int64),
        readings=readings,
        action=recording.action,
        wanted=recording.wanted,
        states=recording.states,
        transits=tuple((row_of[one.tick], Transit(*one[1:])) for one in recording.transitions if one.tick in row_of),
    )


def figures(recording: Recording) -> dict[str, Any]:
    """What a recording tells of its drive: way, time, lateness, what is lost; also of a simulated one."""
    ticks, time_s = recording.tick, recording.time_s
    distance = recording.observation[:, CORE_LAYOUT.column("distance")].astype(float)
    seconds = float(time_s[-1] - time_s[0]) if len(ticks) > 1 else 0.0
    metres = float(distance[-1] - distance[0]) if len(ticks) else 0.0
    late = recording.lateness_s[recording.lateness_s > 0]
    return {
        "source": recording.source,
        "ticks": len(ticks),
        "missing_ticks": int(ticks[-1] + 1 - len(ticks)) if len(ticks) else 0,
        "time_s": float(time_s[-1]) if len(ticks) else 0.0,
        "distance_m": metres,
        "mean_speed_mps": metres / seconds if seconds else 0.0,
        "late_ticks": int(recording.late_ticks[-1]) if len(ticks) else 0,
        "max_lateness_s": float(late.max()) if len(late) else 0.0,
        "states": _stretches(recording.states),
        "damage": recording.damage,
        "words": list(recording.words),
    }


def _stretches(states: tuple[str, ...]) -> dict[str, int]:
    """State -> number of its ticks, in the order of their first ones; a policy without states has none."""
    counts: dict[str, int] = {}
    for name, ticks in groupby(states):
        if name:
            counts[name] = counts.get(name, 0) + sum(1 for _ in ticks)
    return counts


def measured_ticks(recording: Recording) -> list[Tick]:
    """The ticks of a drive whose truth nobody knows; its info holds what the video shows."""
    trace, distance = measured_trace(recording), CORE_LAYOUT.column("distance")
    ticks = []
    for k in range(len(recording.tick)):
        info = {"time_s": float(trace.time[k]), "speed_mps": float(trace.speed[k])}
        info["distance_m"] = float(trace.readings[k, distance])
        ticks.append(
            Tick(
                index=k,
                observation=recording.observation[k],
                state=recording.states[k],
                action=recording.action[k].astype(np.float32),
                info=info,
            )
        )
    return ticks
