"""Readings made ready for a network."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import CONTROL_PERIOD_S, NO_ECHO_M, TURN_MARKER_IDS, Layout
from tral_env.learner.config import LearnerConfig

Values = NDArray[np.float32]

RANGE_M = NO_ECHO_M / 2
"""A range of this is 0, one of twice as much 1."""
_RANGE_AGE_S = 0.2
"""A range of this age or more has the age 1; the slowest sonar answers every 0.11 s."""
_SPEED_MPS = 2.0
"""This speed is 1."""
AHEAD_M = 5.0
"""A gate or sign so far ahead is at 1."""
ASIDE_M = 2.0
"""A gate or sign so far to the left is at 1."""
MEMORY_S = 5.0
"""A gate or sign counts as seen for so long; the car may meanwhile have turned away from it."""

_LOW, _HIGH = np.float32(-1.0), np.float32(1.0)
"""Features lie between."""
RANGES = ("left", "front", "right")
DETECTIONS = ("gate", "marker")


def feature_names(detections: bool = True) -> tuple[str, ...]:
    """Names of the features of one frame, in order.

    Args:
        detections: whether gates and turn signs are among them.
    """
    ranges = [f"{side}_{what}" for what in ("range", "age", "echo") for side in RANGES]
    names = [*ranges, "speed", "steering", "throttle", "way"]
    if detections:
        names += [f"{kind}_{what}" for what in ("x", "y", "age", "sin", "cos", "seen") for kind in ("gate", "sign")]
        names += [f"sign_{turn}" for turn in TURN_MARKER_IDS]
    return tuple(names)


class Features:
    """Makes frames of features out of readings, in place: a single car's computer decides 20 times a second."""

    def __init__(self, layout: Layout, config: LearnerConfig) -> None:
        column = layout.column
        self._detections = config.detections and not config.memory
        self.names = feature_names(self._detections)
        scaled: list[tuple[str, float, float]] = [
            *((f"ultrasonic_{side}", -1.0, 1 / RANGE_M) for side in RANGES),
            *((f"ultrasonic_{side}_age", 0.0, 1 / _RANGE_AGE_S) for side in RANGES),
            *((f"ultrasonic_{side}", 0.0, 1.0) for side in RANGES),  # echoes, which `frames` fills
            ("speed", 0.0, 1 / _SPEED_MPS),
            ("steering", 0.0, 1.0),
            ("throttle", 0.0, 1.0),
            ("distance", 0.0, 1.0),  # the way, which `frames` fills
        ]
        if self._detections:
            for what, factor in (("x", 1 / AHEAD_M), ("y", 1 / ASIDE_M), ("age", 1 / MEMORY_S)):
                scaled += [(f"{kind}_{what}", 0.0, factor) for kind in DETECTIONS]
        self._columns = np.array([column(name) for name, _, _ in scaled])
        self._offset = np.array([offset for _, offset, _ in scaled], np.float32)
        self._factor = np.array([factor for _, _, factor in scaled], np.float32)
        self._headings = np.array([column(f"{kind}_heading") for kind in DETECTIONS])
        self._ids = np.array([column(f"{kind}_id") for kind in DETECTIONS])
        self._turns = np.array([*TURN_MARKER_IDS.values()], np.float32)
        self._way_factor = np.float32(1 / (_SPEED_MPS * config.spacing_ticks * CONTROL_PERIOD_S))

    def frames(self, readings: Values, way: Values, out: Values) -> None:
        """Fill (k, F) with the features of readings (k, d) and of the way (k,) since the last frame, m."""
        scaled = readings.take(self._columns, axis=1)
        np.multiply(scaled, self._factor, out=scaled)
        np.add(scaled, self._offset, out=scaled)
        np.maximum(scaled, _LOW, out=scaled)
        np.minimum(scaled, _HIGH, out=scaled)
        np.less(scaled[:, 0:3], _HIGH, out=scaled[:, 6:9], casting="unsafe")
        np.minimum(np.multiply(way, self._way_factor, out=scaled[:, 12]), _HIGH, out=scaled[:, 12])
        if not self._detections:
            out[:] = scaled
            return
        out[:, :13] = scaled[:, :13]
        self._tell_detections(out, readings, scaled[:, 13:])

    def _tell_detections(self, out: Values, readings: Values, scaled: Values) -> None:
        """Fill the features of gates and signs: 0 but for the age where nothing was seen lately."""
        seen = scaled[:, 4:6] < _HIGH
        out[:, 13:] = 0.0
        out[:, 17:19] = 1.0
        if not np.count_nonzero(seen):
            return
        ids = readings.take(self._ids, axis=1)
        turns = ids[:, 1:] == self._turns
        seen[:, 0] &= ids[:, 0] >= 0.0
        seen[:, 1] &= turns.any(axis=1)
        heading = readings.take(self._headings, axis=1)
        np.multiply(scaled[:, 0:2], seen, out=out[:, 13:15])
        np.multiply(scaled[:, 2:4], seen, out=out[:, 15:17])
        np.copyto(out[:, 17:19], scaled[:, 4:6], where=seen)
        np.multiply(np.sin(heading), seen, out=out[:, 19:21])
        np.multiply(np.cos(heading), seen, out=out[:, 21:23])
        out[:, 23:25] = seen
        np.multiply(turns, seen[:, 1:], out=out[:, 25:28])
