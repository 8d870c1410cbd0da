"""When images are exposed and when what they show is known: a camera's rate and latency, for n cars."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import MAX_AGE_S, NOTHING_SEEN_ID
from tral_env.perception.gate import Detection

Array = NDArray[np.float64]
Index = NDArray[np.int64]

IN_FLIGHT = 4
"""Images on their way from the sensor to the detector that there is room for at first: 15 Hz and 120 ms make two."""
SUBJECTS = ("gate", "marker")
QUANTITIES = ("id", "x", "y", "heading")
_EPSILON_S = 1e-9


class CameraPipeline:
    """The last gate and the last marker that each of n cars has seen.

    A sighting stays until a newer one replaces it and grows old meanwhile; an image in which nothing is seen changes
    nothing.
    """

    def __init__(self, n: int, rate_hz: float) -> None:
        """Nothing seen yet."""
        self._period_s = 1.0 / rate_hz
        self._next_exposure = np.zeros(n)
        self._latency_s = np.zeros(n)
        self._known = np.zeros((n, len(SUBJECTS), len(QUANTITIES)))
        self._known_exposed = np.full((n, len(SUBJECTS)), -np.inf)
        self._queue = np.zeros((n, IN_FLIGHT, len(SUBJECTS), len(QUANTITIES)))
        self._queue_exposed = np.full((n, IN_FLIGHT), np.inf)
        self._slot = np.zeros(n, np.int64)
        self.reset(np.arange(n), np.zeros(n))

    def reset(self, rows: Index, latency_s: Array) -> None:
        """Forget everything; the first image is exposed at once. `latency_s` is (k,)."""
        self._make_room(float(latency_s.max(initial=0.0)))
        self._next_exposure[rows] = 0.0
        self._latency_s[rows] = latency_s
        self._known[rows] = 0.0
        self._known[rows, :, 0] = NOTHING_SEEN_ID
        self._known_exposed[rows] = -np.inf
        self._queue_exposed[rows] = np.inf
        self._slot[rows] = 0

    def _make_room(self, latency_s: float) -> None:
        """Let the queue hold all images that a slow camera has on their way; one too few, and none would arrive."""
        more = int(np.ceil(latency_s / self._period_s)) + 2 - self._queue_exposed.shape[1]
        if more > 0:
            self._queue = np.pad(self._queue, ((0, 0), (0, more), (0, 0), (0, 0)))
            self._queue_exposed = np.pad(self._queue_exposed, ((0, 0), (0, more)), constant_values=np.inf)

    def due(self, rows: Index, time_s: Array) -> Index:
        """Those of the rows whose camera exposes an image now. `time_s` is (n,)."""
        due = rows[time_s[rows] >= self._next_exposure[rows] - _EPSILON_S]
        self._next_exposure[due] += self._period_s
        return due

    def expose(self, rows: Index, time_s: Array, seen: Detection) -> None:
        """Images are taken.

        Args:
            rows: (k,) cars.
            time_s: (n,) now.
            seen: what they show, arrays of (k,).
        """
        if not (seen.gate_seen | seen.marker_seen).any():
            return
        slot = self._slot[rows]
        for i, subject in enumerate(SUBJECTS):
            for j, quantity in enumerate(QUANTITIES):
                self._queue[rows, slot, i, j] = getattr(seen, f"{subject}_{quantity}")
        self._queue_exposed[rows, slot] = time_s[rows]
        self._slot[rows] = (slot + 1) % self._queue_exposed.shape[1]

    def deliver(self, time_s: Array) -> None:
        """Publish what has come through the latency by now. `time_s` is (n,)."""
        if self._queue_exposed.min() == np.inf:
            return
        arrived = self._queue_exposed + self._latency_s[:, None] <= time_s[:, None] + _EPSILON_S
        for slot in np.flatnonzero(arrived.any(axis=0)):
            rows = np.flatnonzero(arrived[:, slot])
            seen = self._queue[rows, slot, :, 0] != NOTHING_SEEN_ID
            newer = seen & (self._queue_exposed[rows, slot, None] > self._known_exposed[rows])
            at = rows[:, None].repeat(len(SUBJECTS), axis=1)[newer], np.nonzero(newer)[1]
            self._known[at] = self._queue[at[0], slot, at[1]]
            self._known_exposed[at] = self._queue_exposed[at[0], slot]
            self._queue_exposed[rows, slot] = np.inf

    def readings(self, time_s: Array) -> dict[str, Array]:
        """``gate_id`` .. ``marker_age`` -> (n,), as the interface names them. `time_s` is (n,)."""
        out = {}
        for i, subject in enumerate(SUBJECTS):
            for j, quantity in enumerate(QUANTITIES):
                out[f"{subject}_{quantity}"] = self._known[:, i, j]
            out[f"{subject}_age"] = np.minimum(time_s - self._known_exposed[:, i], MAX_AGE_S)
        return out
