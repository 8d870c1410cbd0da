"""What the real car can sense: the protocol, the hall sensor, and several sensors as one."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Protocol

from tral_env.config import HallConfig


class Sensors(Protocol):
    """A source of readings, named as in `tral_env.interface.CORE_FIELDS`."""

    def start(self) -> None:
        """Begin anew, at each reset.

        Raises:
            HardwareError: no answer.
        """

    def read(self, now: float) -> Mapping[str, float]:
        """Latest readings with their ages. Never waits; what is not named has not been seen.

        Args:
            now: time on the environment's clock, s.

        Raises:
            HardwareError: no answer for too long, or nonsense.
        """
        ...

    def stop(self) -> None:
        """Let go of the device. A second call does nothing."""


class SensorGroup:
    """Several sensors as one."""

    def __init__(self, *members: Sensors) -> None:
        """Group sensors; a reading that two of them name is the later one's."""
        self._members = members

    def start(self) -> None:
        """Begin anew, all of them."""
        for member in self._members:
            member.start()

    def read(self, now: float) -> Mapping[str, float]:
        """Readings of all."""
        readings: dict[str, float] = {}
        for member in self._members:
            readings.update(member.read(now))
        return readings

    def stop(self) -> None:
        """Let go of all of them, also when one fails."""
        self._stop(0)

    def _stop(self, first: int) -> None:
        if first < len(self._members):
            try:
                self._members[first].stop()
            finally:
                self._stop(first + 1)


class HallCounter:
    """Distance and speed from the edges of the hall sensor on a wheel. It knows no direction.

    The speed follows the law of `tral_env.sensors.hall.Hall`: the median of the last three spacings, never more than
    one edge in the time since the last one, and 0 once an edge is overdue.

    Hand `edge` to whatever watches the pin, for example as ``when_activated`` of gpiozero.
    """

    def __init__(self, config: HallConfig | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        """Count from zero.

        Args:
            config: distance of an edge, and how long without one is standing.
            clock: the environment's clock, s.
        """
        self._config, self._clock = config or HallConfig(), clock
        self._lock = threading.Lock()
        self.start()

    def start(self) -> None:
        """Count from zero."""
        with self._lock:
            self._edges, self._last = 0, -math.inf
            self._spacings: deque[float] = deque([math.inf] * 3, maxlen=3)

    def edge(self) -> None:
        """One magnet has passed. May be called from another thread."""
        now = self._clock()
        with self._lock:
            spacing = max(now - self._last, self._config.stamp_s)
            self._edges, self._last = self._edges + 1, now
            if spacing > self._config.timeout_s:
                spacing = math.inf
            # From rest the first spacing known stands for all three; a pause makes all three unknown.
            anew = math.inf in (spacing, self._spacings[-1])
            self._spacings.extend([spacing] * (3 if anew else 1))

    def read(self, now: float) -> Mapping[str, float]:
        """Distance since the start [m] and speed [m/s].

        Args:
            now: time, s.
        """
        with self._lock:
            edges, waited, spacing = self._edges, now - self._last, sorted(self._spacings)[1]
        metres = self._config.metres_per_tick
        standing = waited > self._config.timeout_s
        return {"distance": edges * metres, "speed": 0.0 if standing else metres / max(spacing, waited)}

    def stop(self) -> None:
        """Nothing to let go of."""
