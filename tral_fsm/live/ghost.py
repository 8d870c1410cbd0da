"""The best earlier drive of a course as a ghost: a pale car that drives it again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tral_env.interface import CONTROL_PERIOD_S, CONTROL_RATE_HZ
from tral_env.se2 import Pose
from tral_fsm.live.frame import Course, Ghost
from tral_fsm.live.lane import ARRIVED, Lane

_MIN_PROGRESS = 0.02
"""A drive that went no further leaves no ghost."""
_MAX_TICKS = round(20 * 60 * CONTROL_RATE_HZ)
"""Longer drives leave none either: 20 minutes."""


@dataclass(kw_only=True)
class _Run:
    """A drive of a car."""

    driver: str
    poses: list[Pose]
    progress: float = 0.0
    has_arrived: bool = False

    @property
    def rank(self) -> tuple[bool, float, int]:
        """More is better: arrived in less time, else further."""
        return self.has_arrived, 1.0 if self.has_arrived else self.progress, -len(self.poses)

    @property
    def told(self) -> str:
        """Who drove, and how it went."""
        time_s = len(self.poses) * CONTROL_PERIOD_S
        return (
            f"{self.driver}, {time_s:.1f} s" if self.has_arrived else f"{self.driver}, {self.progress:.0%} of the way"
        )


class Ghosts:
    """Remembers the drives of one course, and keeps the best."""

    def __init__(self) -> None:
        self._course: Course | None = None
        self._runs: list[_Run] = []
        self._best: _Run | None = None

    def begin(self, course: Course) -> None:
        """A drive begins; the one that ends with it is kept if it was the best on this course."""
        if course != self._course:
            self._course, self._best = course, None
        else:
            found = [run for run in [*self._runs, self._best] if run is not None and run.progress >= _MIN_PROGRESS]
            self._best = max(found, key=lambda run: run.rank, default=None)
        self._runs = []

    def note(self, lanes: Sequence[Lane]) -> None:
        """Take a tick of the drive that goes on."""
        if len(self._runs) != len(lanes):
            self._runs = [_Run(driver=lane.driver, poses=[]) for lane in lanes]
        for run, lane in zip(self._runs, lanes, strict=True):
            if run.has_arrived or (lane.ended and lane.ended != ARRIVED) or len(run.poses) >= _MAX_TICKS:
                continue
            run.driver = lane.driver
            pose, run.progress = lane.place()
            run.poses.append(pose)
            run.has_arrived = lane.ended == ARRIVED

    def at(self, time_s: float) -> Ghost | None:
        """The ghost at a moment of the drive; at its end it stands. None: there was no earlier drive."""
        if self._best is None:
            return None
        poses = self._best.poses
        tick = min(max(round(time_s / CONTROL_PERIOD_S) - 1, 0), len(poses) - 1)
        return Ghost(name=self._best.told, pose=poses[tick])
