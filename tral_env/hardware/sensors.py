"""What the real car can sense: the protocol, the hall sensor, and several sensors as one."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from tral_env.config import HallConfig
from tral_env.sensors.hall import EdgeSpeed


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

    The law is that of the simulated sensor, `tral_env.sensors.hall.EdgeSpeed`, for one wheel.

    Hand `edge` to whatever watches the pin, for example as ``when_activated`` of gpiozero.
    """

    def __init__(self, config: HallConfig | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        """Count from zero.

        Args:
            config: distance of an edge, shortest and longest time between two, resolution of their stamps.
            clock: the environment's clock, s.
        """
        self._clock, self._lock = clock, threading.Lock()
        self._edges = EdgeSpeed(1, config or HallConfig())

    def start(self) -> None:
        """Count from zero."""
        with self._lock:
            self._edges.reset(_WHEEL)

    def edge(self) -> None:
        """One magnet has passed. May be called from another thread."""
        now = self._clock()
        with self._lock:
            self._edges.edge(_PASSED, now)

    def read(self, now: float) -> Mapping[str, float]:
        """Distance since the start [m] and speed [m/s].

        Args:
            now: time, s.
        """
        with self._lock:
            distance, speed = self._edges.distance, self._edges.speed(now)
        return {"distance": float(distance[0]), "speed": float(speed[0])}

    def stop(self) -> None:
        """Nothing to let go of."""


_WHEEL, _PASSED = np.array([0]), np.array([True])
