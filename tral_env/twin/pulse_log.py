"""Pulses over time: what servo and motor controller were sent in a period, on the mean."""

from __future__ import annotations

import threading
from collections.abc import Callable


class PulseLog:
    """The pulses of a board since the last look: the board's model notes each change."""

    def __init__(self, read: Callable[[], tuple[float, float]], clock: Callable[[], float]) -> None:
        """Begin with what stands now.

        Args:
            read: gives the pulses of steering and throttle that stand now, us; 0: none.
            clock: gives the time, s.
        """
        self._read, self._clock, self._lock = read, clock, threading.Lock()
        self._changes = [(clock(), read())]

    @property
    def now_us(self) -> tuple[float, float]:
        """Pulses that stand now, us."""
        return self._read()

    def note(self) -> None:
        """Note what stands now; call it after each change."""
        with self._lock:
            self._note()

    def take(self) -> list[tuple[float, tuple[float, float]]]:
        """The pulses since the last look, each with the time for which they stood, s; at least one entry."""
        with self._lock:
            self._note()
            changes, now_s = self._changes, self._clock()
            self._changes = [(now_s, changes[-1][1])]
        ends = [begun_s for begun_s, _ in changes[1:]] + [now_s]
        return [(max(end_s - begun_s, 0.0), us) for (begun_s, us), end_s in zip(changes, ends, strict=True)]

    def _note(self) -> None:
        us = self._read()
        if us != self._changes[-1][1]:
            self._changes.append((self._clock(), us))
