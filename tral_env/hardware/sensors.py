"""Sensors of the real car: their protocol, the hall sensor, and several sensors as one."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tral_env.arrays import number
from tral_env.config import HallConfig
from tral_env.hardware.physical import Physical
from tral_env.sensors.hall import EdgeSpeed

FrameWatcher = Callable[[str, bytes], None]
"""Called with the name of a sensor and the bytes that came from it, before anything is made of them."""
ImageWatcher = Callable[[float, NDArray[np.uint8]], None]
"""Called with an image that does not change any more: its time of exposure on the environment's clock, s, and its
pixels, (height, width, 3) RGB or (height, width) grey."""


class Sensors(Protocol):
    """A source of readings, named as in `tral_env.interface.CORE_FIELDS` and `OPTIONAL_GROUPS`.

    It should also have `provided_readings`, the names of all readings that it may give, as a frozenset: then
    `tral_env.interface.check_readings` can refuse a policy that needs more. With `watch_frames(watcher)`, which takes a
    `FrameWatcher`, a recording has what it received, too; a camera has `watch_images(watcher)`, which takes an
    `ImageWatcher`.
    """

    def start(self) -> None:
        """Begin anew; the environment calls it at each reset.

        Raises:
            HardwareError: no answer.
        """

    def read(self, now: float) -> Mapping[str, float]:
        """Give the latest readings with their ages, at once; a reading that is not named has not come yet.

        Args:
            now: time on the environment's clock, s.

        Raises:
            HardwareError: no answer for too long, or nonsense.
        """
        ...

    def stop(self) -> None:
        """Let go of the device; a second call does nothing."""


def provided_by(sensors: Sensors | None) -> frozenset[str] | None:
    """Names of the readings that sensors may give; None: they do not say."""
    if sensors is None:
        return frozenset()
    provided: frozenset[str] | None = getattr(sensors, "provided_readings", None)
    return provided


def watch_frames(sensors: Sensors | None, watcher: FrameWatcher) -> None:
    """Call a watcher for each frame of sensors from now on; those without frames call nothing."""
    watch: Callable[[FrameWatcher], None] | None = getattr(sensors, "watch_frames", None)
    if watch is not None:
        watch(watcher)


def watch_images(sensors: Sensors | None, watcher: ImageWatcher) -> None:
    """Call a watcher for each image of the cameras among sensors from now on."""
    watch: Callable[[ImageWatcher], None] | None = getattr(sensors, "watch_images", None)
    if watch is not None:
        watch(watcher)


class ImageTimes(NamedTuple):
    """Times of a camera's images on the environment's clock, s."""

    exposed_s: float
    """Of the newest one."""
    changed_s: float
    """Of the newest one that differed from the one before it."""


class ImageLog:
    """Notes when the images of a camera were exposed, and when one differed from the one before it."""

    def __init__(self, now_s: float) -> None:
        """No image yet; the camera has until now."""
        self.times = ImageTimes(now_s, now_s)
        self._before: NDArray[np.uint8] | None = None

    def reset(self, now_s: float) -> None:
        """Begin anew: the camera has until now."""
        self.times = ImageTimes(now_s, now_s)

    def note(self, grey: NDArray[np.uint8], exposed_s: float) -> None:
        """Take an image, (height, width); a frozen camera sends the same one again."""
        is_new = self._before is None or not np.array_equal(self._before, grey)
        self._before = grey
        self.times = ImageTimes(exposed_s, exposed_s if is_new else self.times.changed_s)


def image_times(sensors: Sensors | None) -> ImageTimes | None:
    """Times of the images of a camera among sensors; None: there is none."""
    times: ImageTimes | None = getattr(sensors, "image_times", None)
    return times


class SensorGroup(Physical):
    """Several sensors as one."""

    def __init__(self, *members: Sensors) -> None:
        """Group sensors; of a reading that two of them name, the later sensor's counts."""
        self._members = members

    @property
    def provided_readings(self) -> frozenset[str] | None:
        """Names of the readings of all sensors; None: one of them does not say."""
        named = [provided_by(member) for member in self._members]
        known = [names for names in named if names is not None]
        return frozenset().union(*known) if len(known) == len(named) else None

    @property
    def image_times(self) -> ImageTimes | None:
        """Times of the images of the first camera; None: there is none."""
        return next((times for member in self._members if (times := image_times(member)) is not None), None)

    def watch_frames(self, watcher: FrameWatcher) -> None:
        """Call a watcher for each frame of each sensor."""
        for member in self._members:
            watch_frames(member, watcher)

    def watch_images(self, watcher: ImageWatcher) -> None:
        """Call a watcher for each image of each camera."""
        for member in self._members:
            watch_images(member, watcher)

    def start(self) -> None:
        """Begin anew with each sensor."""
        for member in self._members:
            member.start()

    def read(self, now: float) -> Mapping[str, float]:
        """Give the readings of all sensors at a time, s."""
        readings: dict[str, float] = {}
        for member in self._members:
            readings.update(member.read(now))
        return readings

    def stop(self) -> None:
        """Let go of all sensors, also when one of them fails."""
        self._stop(0)

    def _stop(self, first: int) -> None:
        """Let go of the sensors from one on; the error of one comes after the others were let go."""
        if first < len(self._members):
            try:
                self._members[first].stop()
            finally:
                self._stop(first + 1)


class HallCounter(Physical):
    """Distance and speed, without direction, from the edges of the hall sensor on a wheel.

    The model is that of the simulated sensor, `tral_env.sensors.hall.EdgeSpeed`, for one wheel. Give `edge` to the
    program that watches the pin, for example as ``when_activated`` of gpiozero.
    """

    provided_readings = frozenset({"distance", "speed"})

    def __init__(self, config: HallConfig | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        """Count from zero.

        Args:
            config: travel from edge to edge, shortest and longest time between two, resolution of their stamps.
            clock: the environment's clock, s.
        """
        self._clock, self._lock = clock, threading.Lock()
        self._edges = EdgeSpeed(1, config or HallConfig())
        self._watcher: FrameWatcher | None = None

    def watch_frames(self, watcher: FrameWatcher) -> None:
        """Call a watcher for each edge, as the byte 1 of "hall"; it is called by the thread that watches the pin."""
        self._watcher = watcher

    def start(self) -> None:
        """Count from zero."""
        with self._lock:
            self._edges.reset(_WHEEL)

    def edge(self, when: float | None = None) -> None:
        """Count a magnet that has passed; another thread may call it.

        Args:
            when: time of its edge on the environment's clock, s; None: now.
        """
        stamp = self._clock() if when is None else when
        with self._lock:
            self._edges.edge(_PASSED, stamp)
        if self._watcher is not None:
            self._watcher("hall", b"\1")

    def read(self, now: float) -> Mapping[str, float]:
        """Give the distance since the start, m, and the speed, m/s, at a time, s."""
        with self._lock:
            distance, speed = self._edges.distance, self._edges.speed(now)
        return {"distance": float(number(distance)), "speed": float(number(speed))}

    def stop(self) -> None:
        """Do nothing: the program that watches the pin owns it."""


_WHEEL, _PASSED = np.array([0]), np.array([True])
"""The one wheel of a counter, as a row and as a mask."""
