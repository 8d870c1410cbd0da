"""What learners see of n cars."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import Flags
from tral_env.interface import CORE_LAYOUT, Layout
from tral_env.learner.config import LearnerConfig
from tral_env.learner.features import Features, Values
from tral_env.learner.memory import Memory


class LearnerView:
    """What learners see of n cars: `history` frames, the oldest first, the newest of now.

    With a `growth` above 1 the frames lie the closer together the younger they are, and a few of them reach far back.

    A frame is the readings, or these features of the core readings, all in [-1, 1]:

    | feature | what it is |
    | --- | --- |
    | `left_range`, `front_range`, `right_range` | range / 3 m - 1; 1: no echo |
    | `left_age`, ... | age of the range / 0.2 s, at most 1 |
    | `left_echo`, ... | 1: there was an echo, 0: none |
    | `speed` | speed / 2 m/s |
    | `steering`, `throttle` | the last command, as applied |
    | `way` | way since the frame before / way at 2 m/s, at most 1 |
    | `gate_x`, `sign_x` | forward distance of the gate or turn sign / 5 m |
    | `gate_y`, `sign_y` | its distance to the left / 2 m |
    | `gate_age`, `sign_age` | age of the detection / 5 s; 1: nothing seen for so long |
    | `gate_sin`, `gate_cos`, ... | sine and cosine of its heading |
    | `gate_seen`, `sign_seen` | 1: seen in the last 5 s; else the features above but the age are 0 |
    | `sign_left`, `sign_right`, `sign_straight` | 1: the sign tells this turn |

    With `memory` the features of gate and sign stand once, behind the frames. They are of now, by dead reckoning, and
    last 10 s; an age of 1 is 10 s. `left_post_x`, `right_post_x` and the like tell the marker on either side
    of a gate. See `tral_env.learner.memory.Memory`.
    """

    def __init__(self, config: LearnerConfig, n: int, layout: Layout = CORE_LAYOUT) -> None:
        """Make the view; `reset` must come first for each car.

        Args:
            config: what is seen.
            n: number of cars.
            layout: columns of the readings.
        """
        self.config, self.n = config, n
        self._features = Features(layout, config) if config.observation == "features" else None
        self.frame_names = layout.names if self._features is None else self._features.names
        """(F,) names of the columns of a frame."""
        remembers = self._features is not None and config.detections and config.memory
        self._memory = Memory(layout, config, n) if remembers else None
        self.memory_names = Memory.names if remembers else ()
        """(M,) names of what stands behind the frames."""
        self._distance = layout.column("distance")
        self._interval = config.interval_ticks
        self._stride = config.spacing_ticks // self._interval
        self._shown = config.kept_frames - 1 - np.array(config.ages)
        self._frames = np.zeros((n, config.kept_frames, len(self.frame_names)), np.float32)
        self._way = np.zeros((n, self._stride), np.float64)
        """(n, stride) distance counted at the frames kept last, m."""
        self._tick = np.zeros(n, np.int64)
        """(n,) ticks since reset."""
        self._common: int | None = None
        """The same as a number where it is that of all cars: this saves half the time of a single car."""

    @property
    def size(self) -> int:
        """Length of an observation: frames times columns, and the memory."""
        return self.config.history * len(self.frame_names) + len(self.memory_names)

    @property
    def common_due(self) -> bool | None:
        """Whether a decision is due in all cars; None: they began at different times, see `due`."""
        return None if self._common is None else self._common % self.config.decision_ticks == 0

    @property
    def due(self) -> Flags:
        """(n,) a decision is due."""
        if self._common is not None:
            return np.full(self.n, self._common % self.config.decision_ticks == 0)
        is_due: Flags = self._tick % self.config.decision_ticks == 0
        return is_due

    def reset(self, rows: Flags, readings: NDArray[np.floating]) -> None:
        """Begin episodes: every frame is the first one.

        Args:
            rows: (n,) which cars.
            readings: (n, d), in the columns of the layout.
        """
        self._tick[rows] = 0
        self._common = 0 if rows.all() else None
        distance = readings[rows, self._distance]
        self._way[rows] = distance[:, None]
        first = np.empty((len(distance), len(self.frame_names)), np.float32)
        self._fill(np.asarray(readings[rows], np.float32), np.zeros_like(distance), first)
        self._frames[rows] = first[:, None]
        if self._memory is not None and rows.any():
            now = np.asarray(readings, np.float32)
            self._memory.reset(rows, now)
            self._memory.update(now, rows)

    def update(self, readings: NDArray[np.floating], rows: Flags | None = None, ended: Flags | None = None) -> None:
        """Take over what was read after a tick.

        Args:
            readings: (n, d).
            rows: (n,) the cars that moved; None: all.
            ended: (n,) cars whose episode ended in this tick: they keep a frame at once, since no other will come.
        """
        if rows is None and self._common is not None:
            self._tick += 1
            self._common += 1
            if self._common % self._interval == 0:
                self._keep_all(readings)
            elif ended is not None and ended.any():
                self._keep(ended, readings)
            return
        self._common = None
        moved = True if rows is None else rows
        self._tick += moved
        keep = moved & (self._tick % self._interval == 0)
        keep = keep if ended is None else keep | ended
        if keep.any():
            self._keep(keep, readings)

    def _keep_all(self, readings: NDArray[np.floating]) -> None:
        """Keep a frame of each car, and forget the oldest."""
        now = np.asarray(readings, np.float32)
        distance = now[:, self._distance].astype(np.float64)
        way = (distance - self._way[:, 0]).astype(np.float32)
        self._way[:, :-1] = self._way[:, 1:]
        self._way[:, -1] = distance
        self._frames[:, :-1] = self._frames[:, 1:]
        self._fill(now, way, self._frames[:, -1])
        if self._memory is not None:
            self._memory.update(now)

    def _keep(self, rows: Flags, readings: NDArray[np.floating]) -> None:
        """Keep a frame of some cars, and forget the oldest."""
        now = np.asarray(readings[rows], np.float32)
        distance = now[:, self._distance].astype(np.float64)
        way = (distance - self._way[rows, 0]).astype(np.float32)
        self._way[rows] = np.concatenate([self._way[rows, 1:], distance[:, None]], axis=1)
        newest = np.empty((len(now), 1, len(self.frame_names)), np.float32)
        self._fill(now, way, newest[:, 0])
        self._frames[rows] = np.concatenate([self._frames[rows, 1:], newest], axis=1)
        if self._memory is not None:
            self._memory.update(np.asarray(readings, np.float32), rows)

    def _fill(self, readings: Values, way: Values, out: Values) -> None:
        if self._features is None:
            out[:] = readings
        else:
            self._features.frames(readings, way, out)

    def observation(self) -> Values:
        """What the learners see now, (n, H * F + M)."""
        frames = self._frames.take(self._shown, axis=1).reshape(self.n, -1)
        return frames if self._memory is None else np.concatenate([frames, self._memory.told()], axis=1)
