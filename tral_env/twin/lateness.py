"""How late the ticks of a loop are: percentiles over the last minutes, in little memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

_KEPT = 80 * 600
"""Ticks of ten minutes."""


class Lateness:
    """Times by which ticks were too late, s."""

    def __init__(self) -> None:
        """No tick yet."""
        self._late_s: deque[float] = deque(maxlen=_KEPT)
        self.ticks = 0
        self.lost_s = 0.0
        """Time that was skipped because the computer stood still for longer than could be made up for, s."""

    def add(self, late_s: float) -> None:
        """Note a tick."""
        self.ticks += 1
        self._late_s.append(late_s)

    def record(self) -> Mapping[str, float]:
        """Number of ticks, and their lateness, ms: median, 99th percentile, greatest; time lost, s."""
        ordered = sorted(self._late_s) or [0.0]
        last = len(ordered) - 1
        return {
            "ticks": self.ticks,
            "late_p50_ms": ordered[round(0.5 * last)] * 1e3,
            "late_p99_ms": ordered[round(0.99 * last)] * 1e3,
            "late_max_ms": ordered[last] * 1e3,
            "lost_s": self.lost_s,
        }
