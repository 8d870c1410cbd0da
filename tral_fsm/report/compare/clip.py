"""A short video of the end of a drive, small enough to lie in a page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tral_env.interface import CONTROL_RATE_HZ
from tral_env.recording.video import VideoWriter
from tral_fsm.evaluation.episode import Tick
from tral_fsm.report.drive.video import Views

WIDTH, HEIGHT = 320, 240
"""Size of the picture, px."""
FPS = 10
"""Frames per second; a clip runs in real time."""
LAST_S = 4.0
"""A clip shows the last seconds of a drive, s."""
_EVERY = round(CONTROL_RATE_HZ / FPS)


class Clip:
    """Keeps pictures of the car from behind; `evaluation.rollout.drive` takes it as `on_step`."""

    def __init__(self, views: Views, time_s: float) -> None:
        """Wait for the end of a drive.

        Args:
            views: the env that renders the views.
            time_s: when the drive will end, s.
        """
        self._views, self._from_s = views, time_s - LAST_S
        self._frames: list[NDArray[np.uint8]] = []

    def __call__(self, tick: Tick) -> None:
        """Take a picture if one is due."""
        if tick.index % _EVERY == 0 and tick.info["time_s"] >= self._from_s:
            self._frames.append(self._views.render_view("chase", WIDTH, HEIGHT))

    @property
    def has_pictures(self) -> bool:
        """Whether the drive lasted until its last seconds were expected."""
        return bool(self._frames)

    def write(self, path: Path) -> None:
        """Write an mp4 file; the last picture stays for a second.

        Raises:
            RenderError: there is no encoder.
        """
        with VideoWriter(path, fps=FPS, quality=30) as video:
            for frame in self._frames + self._frames[-1:] * FPS:
                video.add(frame)
