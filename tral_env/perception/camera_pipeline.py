"""A camera's rate and latency, for n cars: when it exposes images, and when their content is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tral_env.arrays import Array, Index, Rows, columns, everyone, is_any, minimum, pick
from tral_env.interface import MAX_AGE_S, NOTHING_SEEN_ID
from tral_env.perception.gate import Detection

IN_FLIGHT = 4
"""The queue has room for so many images at first: at 15 Hz and 120 ms two are on their way to the detector."""
SUBJECTS = ("gate", "marker")
"""An image tells of these."""
QUANTITIES = ("id", "x", "y", "heading")
"""An image tells this of each subject, m and rad."""
_NAMES = tuple(f"{subject}_{quantity}" for subject in SUBJECTS for quantity in QUANTITIES)
_AGES = tuple(f"{subject}_age" for subject in SUBJECTS)
_NOBODY = np.zeros(0, np.int64)
_EPSILON_S = 1e-9
"""Times that differ by less are equal."""


def has_arrived(exposed_s: ArrayLike, latency_s: ArrayLike, time_s: ArrayLike) -> NDArray[np.bool_]:
    """Whether what was exposed at a time is known now; each a scalar or an array, s."""
    return np.less_equal(np.add(exposed_s, latency_s), np.add(time_s, _EPSILON_S))


class CameraPipeline:
    """The last gate and the last marker that each of n cars has seen.

    A detection stays until a newer one replaces it, and its age grows meanwhile; an image that shows nothing changes
    nothing.
    """

    def __init__(self, n: int, rate_hz: float) -> None:
        """Begin with nothing seen, and an image at once.

        Args:
            n: number of cars.
            rate_hz: images in a second.
        """
        self._period_s = 1.0 / rate_hz
        self._row, self._everyone = np.arange(n), everyone(n)
        self._next_exposure = np.zeros(n)
        self._latency_s = np.zeros(n)
        self._known = np.zeros((n, len(SUBJECTS), len(QUANTITIES)))
        self._known_exposed = np.full((n, len(SUBJECTS)), -np.inf)
        self._queue = np.zeros((n, IN_FLIGHT, len(SUBJECTS), len(QUANTITIES)))
        self._queue_exposed = np.full((n, IN_FLIGHT), np.inf)
        self._slot = np.zeros(n, np.int64)
        self._is_empty = True
        """Whether no image is on its way."""
        self.reset(np.arange(n), np.zeros(n))

    def reset(self, rows: Index, latency_s: Array) -> None:
        """Forget all that the cars (k,) have seen; they expose an image at once.

        Args:
            rows: (k,) cars.
            latency_s: (k,) time from exposure to detection, s.
        """
        self._make_room(float(latency_s.max(initial=0.0)))
        self._next_exposure[rows] = 0.0
        self._latency_s[rows] = latency_s
        self._known[rows] = 0.0
        self._known[rows, :, 0] = NOTHING_SEEN_ID
        self._known_exposed[rows] = -np.inf
        self._queue_exposed[rows] = np.inf
        self._slot[rows] = 0

    def _make_room(self, latency_s: float) -> None:
        """Let the queue hold all images that a slow camera has on their way; with a place too few none would arrive."""
        more = int(np.ceil(latency_s / self._period_s)) + 2 - self._queue_exposed.shape[1]
        if more > 0:
            self._queue = np.pad(self._queue, ((0, 0), (0, more), (0, 0), (0, 0)))
            self._queue_exposed = np.pad(self._queue_exposed, ((0, 0), (0, more)), constant_values=np.inf)

    def trigger(self, rows: Rows, time_s: Array) -> Index:
        """Trigger the cameras whose time has come, and give their rows.

        Args:
            rows: cars to look at.
            time_s: (n,) now, s.
        """
        is_due = pick(time_s, rows) >= pick(self._next_exposure, rows) - _EPSILON_S
        if not is_any(is_due):
            return _NOBODY
        due: Index = self._row[rows][is_due]
        self._next_exposure[due] += self._period_s
        return due

    def expose(self, rows: Index, time_s: Array, seen: Detection) -> None:
        """Put the content of new images into the queue.

        Args:
            rows: (k,) cars whose cameras were triggered.
            time_s: (n,) now, s.
            seen: what the images show, arrays of (k,).
        """
        if not (seen.gate_seen | seen.marker_seen).any():
            return
        slot = self._slot[rows]
        for i, subject in enumerate(SUBJECTS):
            for j, quantity in enumerate(QUANTITIES):
                self._queue[rows, slot, i, j] = getattr(seen, f"{subject}_{quantity}")
        self._queue_exposed[rows, slot] = time_s[rows]
        self._is_empty = False
        self._slot[rows] = (slot + 1) % self._queue_exposed.shape[1]

    def deliver(self, time_s: Array) -> None:
        """Publish the images whose latency is over; `time_s`, (n,) s, is now."""
        if self._is_empty:
            return
        arrived = has_arrived(self._queue_exposed, self._latency_s[:, None], time_s[:, None])
        for slot in np.flatnonzero(arrived.any(axis=0)):
            rows = np.flatnonzero(arrived[:, slot])
            seen = self._queue[rows, slot, :, 0] != NOTHING_SEEN_ID
            newer = seen & (self._queue_exposed[rows, slot, None] > self._known_exposed[rows])
            at = rows[:, None].repeat(len(SUBJECTS), axis=1)[newer], np.nonzero(newer)[1]
            self._known[at] = self._queue[at[0], slot, at[1]]
            self._known_exposed[at] = self._queue_exposed[at[0], slot]
            self._queue_exposed[rows, slot] = np.inf
        self._is_empty = bool(self._queue_exposed.min() == np.inf)

    def readings(self, time_s: Array) -> dict[str, Array]:
        """``gate_id`` .. ``marker_age``, as the interface names them; `time_s`, (n,) s, is now.

        Each (n,), or the number of a car alone.
        """
        rows = self._everyone
        now, known = pick(time_s, rows), columns(self._known.reshape(len(self._known), -1), rows)
        out = dict(zip(_NAMES, known, strict=True))
        for name, exposed in zip(_AGES, columns(self._known_exposed, rows), strict=True):
            out[name] = minimum(now - exposed, MAX_AGE_S)
        return out
