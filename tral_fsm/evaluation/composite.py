"""One figure for a drive: completion x penalties, each factor in [0, 1].

    score = progress x outcome x pace x steering

Progress is the share of the route: what the car was sent out for. The other factors are told where their numbers stand,
each with its reason. A drive that fails has lost the rest of its route already, so its outcome costs it twice: a car
that crashes at the goal is worse than one that stands before it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

OUTCOME_FACTORS: Mapping[str, float] = {
    "success": 1.0,
    "timeout": 0.7,
    "missed_gate": 0.7,
    "touch": 0.65,
    "crash": 0.5,
}
"""Factor of each outcome. Source: penalties of CARLA's driving score: 0.7 for a route that took too long and for a rule
that was broken, 0.65 for a static thing that was hit, 0.5 for the worst collision."""
EASY_MPS = 0.6
"""A car with this mean pace along its route loses nothing. Source: choice; twice `TaskConfig.nominal_speed`."""
SLOW_MPS = 0.3
"""A car with this pace or less has the lowest factor of pace. Source: `TaskConfig.nominal_speed`."""
SLOW_FACTOR = 0.8
"""Factor of a slow car. Source: choice; it costs less than the mildest failure."""
RESTLESS_PER_M = 20.0
"""Steering travel for each metre at which the factor of steering is lowest. Source: choice; twice that of `wall`, which
answers every step of its sonar."""
RESTLESS_FACTOR = 0.9
"""Factor of a restless servo. Source: choice; half the weight of pace."""


def fate(record: Mapping[str, Any]) -> str:
    """Key of `OUTCOME_FACTORS` of a record of a drive (`EpisodeResult.record`)."""
    if record["outcome"] != "collision":
        return str(record["outcome"])
    return "crash" if record["crash"] else "touch"


def pace_mps(record: Mapping[str, Any]) -> float:
    """Mean speed along the route, m/s."""
    return float(record["progress"] * record["route_m"] / record["time_s"])


def steering_per_m(record: Mapping[str, Any]) -> float | None:
    """Steering travel for each metre of the route that was driven, 1/m; None below half a metre."""
    driven = record["progress"] * record["route_m"]
    return float(record["steering_travel"] / driven) if driven >= 0.5 else None


def score(record: Mapping[str, Any]) -> float:
    """Score of a drive in [0, 1], from its record (`EpisodeResult.record`)."""
    slowness = min(max((EASY_MPS - pace_mps(record)) / (EASY_MPS - SLOW_MPS), 0.0), 1.0)
    travel = steering_per_m(record)
    restlessness = 1.0 if travel is None else min(travel / RESTLESS_PER_M, 1.0)
    pace = 1.0 - (1.0 - SLOW_FACTOR) * slowness
    steering = 1.0 - (1.0 - RESTLESS_FACTOR) * restlessness
    return float(record["progress"] * OUTCOME_FACTORS[fate(record)] * pace * steering)
