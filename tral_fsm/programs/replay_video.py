"""replay.mp4: the video of a recorded drive, as `tral drive` makes it.

A simulated drive is driven again, with its commands, for the views. Of a real car the images of its camera are shown.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tral_env.errors import BadFileError
from tral_env.perception import opengl

if TYPE_CHECKING:
    from tral_env.recording.read import Recording
    from tral_fsm.evaluation.episode import Tick
    from tral_fsm.report.drive.video import Stills

Image = NDArray[np.uint8]


def write_video(recording: Recording, path: Path, course: str | None = None) -> None:
    """Write the video of a recording.

    Args:
        recording: the recording.
        path: the file.
        course: see `tral_fsm.evaluation.replay.start_again`.

    Raises:
        BadFileError: the recording of a real car has no image.
        RenderError: this computer has no OpenGL or no encoder.
    """
    from tral_fsm.report.drive.video import DriveVideo

    with contextlib.closing(_views(recording, course)) as views, DriveVideo(path, views) as video:
        for tick in _ticks(recording):
            views.go_on(tick)
            video(tick)


def _views(recording: Recording, course: str | None) -> _Again | _Camera:
    if recording.source == "simulation":
        opengl.require_loadable()
        return _Again(recording, course)
    return _Camera(recording)


def _ticks(recording: Recording) -> Iterator[Tick]:
    from tral_fsm.evaluation.measured import measured_ticks
    from tral_fsm.evaluation.recording import episode_of

    if recording.source == "car":
        yield from measured_ticks(recording)
        return
    ticks: list[Tick] = []
    episode_of(recording, ticks.append)
    yield from ticks


class _Again:
    """The simulated car on the recorded commands."""

    def __init__(self, recording: Recording, course: str | None) -> None:
        from tral_fsm.evaluation.replay import commands_of, simulated_env, start_again

        self._commands, self._next = commands_of(recording), 0
        self._ticks = recording.tick.tolist()
        self._env = simulated_env(recording, render=True)
        start_again(self._env, recording, course)

    def go_on(self, tick: Tick) -> None:
        """Drive up to the end of a recorded tick, and those before it that were dropped."""
        while self._next <= self._ticks[tick.index]:
            self._env.step(self._commands[self._next])
            self._next += 1

    def stills(self) -> Stills:
        """See `tral_fsm.report.drive.video.Filmed`."""
        world: Any = self._env.unwrapped
        stills: Stills = world.stills()
        return stills

    def close(self) -> None:
        """Free what OpenGL holds."""
        self._env.close()


class _Camera:
    """The recorded images, each from its exposure on."""

    def __init__(self, recording: Recording) -> None:
        self._times, self._pictures = recording.time_s, recording.pictures()
        self._coming = next(self._pictures, None)
        if self._coming is None:
            raise BadFileError(f"{recording.path}: there is no video without images of the car's camera")
        self._image: Image = self._coming.pixels()

    def go_on(self, tick: Tick) -> None:
        """Show the last image that was exposed before the end of a tick."""
        while self._coming is not None and self._coming.time_s <= self._times[tick.index]:
            self._image = self._coming.pixels()
            self._coming = next(self._pictures, None)

    def stills(self) -> Stills:
        """See `tral_fsm.report.drive.video.Filmed`."""
        return self

    def take(self, view: str, width: int, height: int) -> Callable[[], Image]:
        """The image, also where the car from behind would be: nobody saw that."""
        from tral_env.simulation.views import fitted

        return partial(fitted, self._image, width, height)

    def close(self) -> None:
        """Do nothing."""
