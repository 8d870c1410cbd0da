"""Watches the images of a camera while the car drives, by the laws of `tral_env.hardware.faults`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tral_env.hardware.faults import FaultLimits, FaultWatch, Finding, Look
from tral_env.hardware.sensors import ImageLog

_FIRST_S = 2.0
"""After arming, the first image may take so long, s: a simulated camera is put into its new scene then. Until then the
policy waits for it in neutral."""


class ImageGuard:
    """Notices a camera whose images are too old, or are one and the same while the car moves.

    Images come from one thread and are judged by another.
    """

    def __init__(self, limits: FaultLimits | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        """Watch nothing until `begin`.

        Args:
            limits: when a fault counts.
            clock: gives a time that never goes back, s.
        """
        self._clock, self._lock = clock, threading.Lock()
        self._watch = FaultWatch(frozenset({"speed"}), limits)
        self._log = ImageLog(clock())
        self._begun_s, self._waits = clock(), True

    def begin(self) -> None:
        """The car was armed: begin anew."""
        with self._lock:
            self._watch.reset()
            self._begun_s, self._waits = self._clock(), True
            self._log.reset(self._begun_s)

    def note(self, grey: NDArray[np.uint8], age_s: float) -> None:
        """Take an image, (height, width), that was exposed so long ago, s; one of the future was exposed now."""
        with self._lock:
            self._log.note(grey, self._clock() - max(age_s, 0.0))
            self._waits = False

    def judge(self, speed: float) -> Finding | None:
        """What is wrong with the images of an armed car that drives at a speed, m/s; None: nothing."""
        with self._lock:
            now_s = self._clock()
            if self._waits and now_s - self._begun_s < _FIRST_S:
                return None
            exposed_s, changed_s = self._log.times
            return self._watch.update(Look(now_s, {"speed": speed}, 0.0, image_s=exposed_s, changed_s=changed_s))
