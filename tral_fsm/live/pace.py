"""Keeps a drive to the clock, and tells how late it is where it cannot."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from tral_env.interface import CONTROL_PERIOD_S

_GIVEN_UP_S = 0.25
"""A drive that is later than this no longer tries to catch up."""
_WINDOW_S = 2.0
"""Speed and lateness are told of about so long a time."""


@dataclass(frozen=True)
class Clock:
    """How time is told and waited for; a test has its own."""

    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep


class Pace:
    """When the next tick is due."""

    def __init__(self, clock: Clock | None = None) -> None:
        """Begin now, in real time."""
        self._clock = clock or Clock()
        self.speed = 1.0
        """Seconds of the drive in a second of the clock; `inf`: as fast as it goes."""
        self.restart()

    def restart(self) -> None:
        """Begin again: nothing is late."""
        self._due = self._since = self._clock.now()
        self._ticks, self._late, self.achieved, self.worst_s = 0, 0.0, self.speed, 0.0

    def wait(self) -> None:
        """Sleep until the next tick is due."""
        now = self._clock.now()
        if now < self._due:
            self._clock.sleep(self._due - now)
        late = max(self._clock.now() - self._due, 0.0)
        self._late = max(self._late, late)
        self._due += CONTROL_PERIOD_S / self.speed
        if late > _GIVEN_UP_S:
            self._due = self._clock.now()
        self._measure()

    def _measure(self) -> None:
        self._ticks += 1
        passed = self._clock.now() - self._since
        if passed >= _WINDOW_S:
            self.achieved = self._ticks * CONTROL_PERIOD_S / passed
            self.worst_s = self._late
            self._since, self._ticks, self._late = self._clock.now(), 0, 0.0

    @property
    def told(self) -> str:
        """What is said where the drive is slower than it should be; empty: it keeps time."""
        if self.speed == float("inf") or self.achieved >= 0.97 * self.speed:
            return ""
        late = f"{1000 * self.worst_s:.0f} ms late"
        return f"real time is not kept: {self.achieved:.2f} s of the drive in a second, a tick was {late}"
