"""What a network that follows a state chart sees beside the readings: the estimate of its car, and its state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Flags
from tral_env.interface import MAX_AGE_S, TURN_MARKER_IDS
from tral_env.learned import Values
from tral_env.learner.features import AHEAD_M, ASIDE_M, RANGE_M
from tral_env.se2 import Pose, clip, relative
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.estimator import MAX_GAIN_ERROR, MAX_TRIM
from tral_fsm.estimation.front_obstacle import FrontObstacle

_CLEARANCE_M = 1.1
"""A clearance of this is 0, none is -1, one of twice as much 1."""
_READINGS = 10.0
"""So many readings are 1."""
_STATE_S, _STATE_M = 5.0, 3.0
"""Time and way in a state that are 1."""
_DETECTIONS = ("gate", "guessed_gate", "marker")

_WALL_NAMES = [f"{side}_wall_{what}" for side in ("left", "right") for what in ("clearance", "known", "lost")]
_CORRIDOR_NAMES = ["heading", "sure", "direction", "steering_offset", "steering_gain"]
_OBSTACLE_NAMES = [
    f"obstacle_{what}" for what in ("range", "first_range", "last_range", "streak", "offset", "offset_known")
]
_DETECTION_NAMES = [
    f"{name}_estimate_{what}"
    for name in _DETECTIONS
    for what in ("x", "y", "sin", "cos", "age", "known", "opening", "opening_known")
]
_SINCE_NAMES = [f"since_{what}" for what in ("time", "way", "x", "y", "sin", "cos")]


def input_names(states: Sequence[str], detections: bool) -> tuple[str, ...]:
    """Names of the inputs, in order: the estimate, which state is active, and what was driven since it began.

    Args:
        states: names of the states.
        detections: whether gates and markers are among them.
    """
    seen = [*_DETECTION_NAMES, "gate_seen_whole", *(f"marker_{turn}" for turn in TURN_MARKER_IDS)] if detections else []
    told = [*_WALL_NAMES, *_CORRIDOR_NAMES, *_OBSTACLE_NAMES, *seen]
    return (*told, *(f"in_{state}" for state in states), *_SINCE_NAMES)


class _Begin(NamedTuple):
    """When and where a state began."""

    time: float = 0.0
    arc_length: float = 0.0
    pose: Pose = (0.0, 0.0, 0.0)


class ChartView:
    """The inputs of n cars, and the state that is active in each; the first state begins."""

    def __init__(self, states: Sequence[str], detections: bool, n: int) -> None:
        """Make the view.

        Args:
            states: names of the states.
            detections: whether gates and markers are among the inputs.
            n: number of cars.
        """
        self._detections, self._of = detections, np.eye(len(states), dtype=np.float32).tolist()
        self.active = np.zeros(n, np.intp)
        """(n,) place of each car's active state among those of the chart."""
        self._begun = [_Begin()] * n

    def reset(self, rows: Flags) -> None:
        """Begin episodes in the cars of `rows` (n,)."""
        self.active[rows] = 0
        for row in np.flatnonzero(rows).tolist():
            self._begun[row] = _Begin()

    def inputs(self, rows: NDArray[np.intp], estimates: Sequence[CarEstimate]) -> Values:
        """Inputs (k, m) of the cars with the numbers `rows` (k,), in [-1, 1]; `estimates` are those of all n cars."""
        return np.array([self._inputs(row, estimates[row]) for row in rows.tolist()], np.float32)

    def _inputs(self, row: int, estimate: CarEstimate) -> list[float]:
        seen = _detections(estimate) if self._detections else []
        state = self._of[self.active[row]]
        return [*_corridor(estimate), *_obstacle(estimate.obstacle), *seen, *state, *_since(estimate, self._begun[row])]

    def enter(self, rows: NDArray[np.intp], states: NDArray[np.intp], estimates: Sequence[CarEstimate]) -> None:
        """Let the states (k,) be active in the cars with the numbers `rows` (k,) from now on."""
        for row, state in zip(rows.tolist(), states.tolist(), strict=True):
            if state != self.active[row]:
                now = estimates[row]
                self.active[row] = state
                self._begun[row] = _Begin(now.time, now.arc_length, now.pose)


def _corridor(estimate: CarEstimate) -> list[float]:
    """Walls, direction and steering."""
    told = []
    for wall, clearance in zip((estimate.left_wall, estimate.right_wall), estimate.clearances(), strict=True):
        known = wall.known
        told += [clip(clearance / _CLEARANCE_M - 1.0) if known else 0.0, float(known), min(wall.lost / _READINGS, 1.0)]
    return [
        *told,
        estimate.heading / (math.pi / 4),
        float(estimate.sure),
        estimate.direction,
        estimate.steering_offset / MAX_TRIM,
        (estimate.steering_gain - 1.0) / MAX_GAIN_ERROR,
    ]


def _obstacle(obstacle: FrontObstacle) -> list[float]:
    """What is ahead."""
    offset = obstacle.lateral_offset
    known = not math.isnan(offset)
    ranges = [clip(each / RANGE_M - 1.0) for each in (obstacle.range, obstacle.first_range, obstacle.last_range)]
    return [*ranges, min(obstacle.streak / _READINGS, 1.0), clip(offset) if known else 0.0, float(known)]


def _detections(estimate: CarEstimate) -> list[float]:
    """Gates and markers."""
    told: list[float] = []
    for name in _DETECTIONS:
        told += _detection(estimate, getattr(estimate, name))
    marker = estimate.marker
    turn = marker.id if marker.age < MAX_AGE_S else -1
    return [*told, float(estimate.gate_seen_whole), *(float(turn == each) for each in TURN_MARKER_IDS.values())]


def _detection(estimate: CarEstimate, detection: Detection) -> list[float]:
    if detection.id < 0 or detection.age >= MAX_AGE_S:
        return [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    x, y, heading = estimate.seen_from_here(detection)
    opening = detection.opening
    measured = not math.isnan(opening)
    return [
        clip(x / AHEAD_M),
        clip(y / ASIDE_M),
        math.sin(heading),
        math.cos(heading),
        detection.age / MAX_AGE_S,
        1.0,
        clip(opening) if measured else 0.0,
        float(measured),
    ]


def _since(estimate: CarEstimate, begun: _Begin) -> list[float]:
    """What was driven since a state began: the time, the way, and where the car was then as seen from where it is."""
    x, y, heading = relative(estimate.pose, begun.pose)
    return [
        clip((estimate.time - begun.time) / _STATE_S),
        clip((estimate.arc_length - begun.arc_length) / _STATE_M),
        clip(x / _STATE_M),
        clip(y / _STATE_M),
        math.sin(heading),
        math.cos(heading),
    ]
