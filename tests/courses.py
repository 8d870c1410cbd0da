"""Machines and drives for the tests of tuning."""

from __future__ import annotations

from typing import Any

import numpy as np

from tral_fsm.conditions.combined import AllSpec
from tral_fsm.conditions.simple import DistanceSpec, SensorLevelSpec
from tral_fsm.definition.machine import MachineDefinition, TransitionSpec
from tral_fsm.evaluation.episode import EpisodeResult
from tral_fsm.evaluation.metrics import ERROR_BINS
from tral_fsm.states.basic import MotorSpec, StopSpec
from tral_fsm.states.fsm_state import FSMStateSpec
from tral_fsm.states.wall import FollowWallSpec

TWO_WALLS = MachineDefinition(
    name="two walls",
    root="right",
    states=(
        FollowWallSpec(id="right", label="along", side="right", speed=0.7, p=1.0, d=1.5),
        FollowWallSpec(id="left", side="left", speed=0.7, p=3.0, d=2.5),
        StopSpec(id=7),
    ),
    transitions=(
        TransitionSpec(id=0, source="right", target="left", when=DistanceSpec(distance=2.0)),
        TransitionSpec(
            id="end",
            source="left",
            target=7,
            when=AllSpec(of=(SensorLevelSpec(below=0.8, readings=2), DistanceSpec(distance=1.0))),
        ),
    ),
)
"""Two states that follow a wall, one that has no gains, and a combined condition."""

NESTED = MachineDefinition(
    root=0, states=(FSMStateSpec(id=0, machine=TWO_WALLS), StopSpec(id=1)),
    transitions=(TransitionSpec(id=0, source=0, target=1, when=DistanceSpec(distance=50.0)),),
)  # fmt: skip
"""A machine in a machine."""


FOLLOW_THEN_CRASH = MachineDefinition(
    root=0,
    states=(
        FollowWallSpec(id=0, label="follow", side="right", speed=0.7, p=1.0, d=1.5),
        MotorSpec(id=1, steering=0.5, speed=1.0, final=True),
    ),
    transitions=(TransitionSpec(id=0, source=0, target=1, when=DistanceSpec(distance=2.0)),),
)
"""Follows a wall for 2 m and then hits one: cheap to drive."""


def blind(steering: float = 0.0, speed: float = 0.7) -> MachineDefinition:
    """Drives with fixed steering: into a wall, if it is not 0."""
    return MachineDefinition(root=0, states=(MotorSpec(id=0, steering=steering, speed=speed, final=True),))


def drive(outcome: str = "success", **others: Any) -> EpisodeResult:
    """A drive of 10 m in 10 s with a clearance RMSE of 3 cm, settled 2 cm."""
    whole = {
        "scenario": "straight", "seed": 0, "outcome": outcome, "crash": False, "progress": 1.0, "route_m": 10.0,
        "time_s": 10.0, "mean_speed": 1.0, "clearance_rmse": 0.03, "clearance_samples": 100,
        "settled_rmse": 0.02, "settled_samples": 80, "lateral_rms": 0.1,
        "steering_travel": 5.0, "gates_passed": 0, "gates_total": 0, "errors": np.zeros(len(ERROR_BINS) - 1, np.int64),
    }  # fmt: skip
    return EpisodeResult(**{**whole, **others})
