"""A recorded drive as something that a page can show."""

from __future__ import annotations

import bisect
import math
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tral_env.course.geometry import build_plan
from tral_env.errors import BadFileError
from tral_env.recording.read import RecordedImage, Recording
from tral_env.se2 import Pose
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.evaluation.recording import course_of, machine_of
from tral_fsm.live.frame import CarFrame, Frame
from tral_fsm.runtime.machine import Transit
from tral_fsm.runtime.policy import MachinePolicy


class Replay:
    """Goes through a recording by the clock; any thread may read `frame`, and move on or back."""

    def __init__(self, recording: Recording, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin at the first tick.

        Args:
            recording: of a car or of a simulation.
            clock: gives the time, s.

        Raises:
            BadFileError: it holds no tick.
        """
        if not len(recording.tick):
            raise BadFileError(f"{recording.path}: there is no tick to show")
        self.recording, self._clock = recording, clock
        self.times = recording.time_s.tolist()
        course = course_of(recording)
        self._plan = None if course is None else build_plan(course)
        self._machine = machine_of(recording)
        self._estimates = estimates(self._machine, recording.observation)
        self._transits = [(one.tick, Transit(*one[1:])) for one in recording.transitions]
        self._pictures: list[RecordedImage] = list(recording.pictures())
        self._lock, self._ended = threading.Lock(), threading.Event()
        self.paused, self.speed = False, 1.0
        self._at, self._since = 0.0, clock()

    def run(self, seconds: float | None = None) -> None:
        """Wait until `close`, or so long."""
        self._ended.wait(seconds)

    def close(self) -> None:
        """End `run`."""
        self._ended.set()

    @property
    def duration_s(self) -> float:
        """Length of the drive, s."""
        return float(self.times[-1]) if self.times else 0.0

    @property
    def time_s(self) -> float:
        """The moment that is shown, s since the start."""
        with self._lock:
            return self._now()

    def _now(self) -> float:
        passed = 0.0 if self.paused else (self._clock() - self._since) * self.speed
        return min(self._at + passed, self.duration_s)

    def go_to(self, time_s: float) -> None:
        """Show another moment, s since the start."""
        with self._lock:
            self._at, self._since = min(max(time_s, 0.0), self.duration_s), self._clock()

    def pause(self, paused: bool) -> None:
        """Stand still, or go on; at the end, from the start."""
        with self._lock:
            self._at, self._since = self._now(), self._clock()
            if not paused and self._at >= self.duration_s:
                self._at = 0.0
            self.paused = paused

    def set_speed(self, speed: float) -> None:
        """Show it faster or slower than it was."""
        with self._lock:
            self._at, self._since, self.speed = self._now(), self._clock(), speed

    @property
    def frame(self) -> Frame:
        """The moment that is shown."""
        now = self.time_s
        k = min(bisect.bisect_left(self.times, now), len(self.times) - 1)
        told = self.recording.configuration
        return Frame(
            episode=0,
            title=f"{self.recording.path.name}: {told.get('scenario', self.recording.source)}",
            plan=self._plan,
            cars=(self._car(k),),
            machine=self._machine,
            as_loaded=self._machine,
            paused=self.paused or now >= self.duration_s,
            speed=self.speed,
            picture=self._picture(now),
        )

    def _car(self, k: int) -> CarFrame:
        recording = self.recording
        truth, estimate = recording.truth[k], self._estimates[k] if self._estimates else None
        side, clearance = recording.wanted[k].tolist()
        there = math.nan if math.isnan(side) else truth.get(f"clearance_{'left' if side > 0 else 'right'}_m")
        fired = bisect.bisect_right(self._transits, int(recording.tick[k]), key=lambda one: one[0])
        return CarFrame(
            name=str(recording.configuration.get("policy", "driver")),
            time_s=self.times[k],
            readings=dict(zip(recording.layout.names, recording.observation[k].tolist(), strict=True)),
            action=(float(recording.action[k, 0]), float(recording.action[k, 1])),
            pose=_pose(truth, estimate),
            state=recording.states[k],
            transit=self._transits[fired - 1][1] if fired else None,
            estimate=estimate,
            speed_mps=_number(truth.get("speed_mps")),
            clearance_error_m=_number(there) - clearance,
            gates=(int(truth.get("gates_passed", 0)), int(truth.get("gates_total", 0))),
            progress=_number(truth.get("progress")),
            ended="the end of the recording" if k == len(self.times) - 1 else "",
        )

    def _picture(self, now: float) -> Callable[[], NDArray[np.uint8]] | None:
        """The last image before a moment."""
        k = bisect.bisect_right(self._pictures, now, key=lambda one: one.time_s)
        return self._pictures[k - 1].pixels if k else None


def estimates(machine: MachineDefinition | None, observation: NDArray[np.float32]) -> list[CarEstimate]:
    """What a machine believed in each tick: it is told the recorded readings again; nothing without a machine."""
    if machine is None:
        return []
    policy, found = MachinePolicy(machine), []
    for row in observation:
        policy.act(row)
        found.append(policy.estimates[0])
    return found


def _pose(truth: dict[str, Any], estimate: CarEstimate | None) -> Pose | None:
    """True pose or, of a real car, the one of dead reckoning."""
    if "x_m" in truth:
        return truth["x_m"], truth["y_m"], truth["yaw_rad"]
    return None if estimate is None else estimate.pose


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
