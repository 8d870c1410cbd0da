"""A drive that goes on by itself, is watched through frames, and is changed by orders between two ticks."""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym

from tral_fsm.evaluation.choices import check_families
from tral_fsm.live.frame import Frame
from tral_fsm.live.lane import Lane
from tral_fsm.live.pace import Clock, Pace
from tral_fsm.runtime.policy import MachinePolicy

_IDLE_S = 0.02
"""A drive that is paused looks for orders so often."""


@dataclass(frozen=True, kw_only=True)
class Course:
    """What is driven."""

    scenario: str = "office"
    """Family of the courses."""
    course: str | None = None
    """Name or file of one course instead."""
    seed: int = 7
    randomization: str = "default"
    camera: str = "projected"


class LiveDrive:
    """Cars on one course, each with its driver.

    Orders come from any thread and are carried out between two ticks, in their order. Frames are read by any thread.
    """

    def __init__(self, course: Course, policies: Sequence[str], *, clock: Clock | None = None) -> None:
        """Put the cars at the start."""
        self.course, self.pace = course, Pace(clock)
        self._clock = clock or Clock()
        self._orders: queue.SimpleQueue[Callable[[LiveDrive], None]] = queue.SimpleQueue()
        self._ends = False
        self._steps = 0
        self.paused = False
        self.episode = 0
        self.lanes = [Lane(self._make_env(), source) for source in policies]
        self.restart()

    def _make_env(self) -> gym.Env[Any, Any]:
        check_families([self.course.scenario])
        return gym.make(
            "tral_env:TralCorridor-v0",
            scenario=self.course.scenario,
            course=self.course.course,
            camera=self.course.camera,
            randomization=self.course.randomization,
        )

    def order(self, what: Callable[[LiveDrive], None]) -> None:
        """Have something done between two ticks, by the thread that drives."""
        self._orders.put(what)

    def restart(self) -> None:
        """Put all cars at the start of the course."""
        for lane in self.lanes:
            lane.start(self.course.seed)
        self.episode += 1
        self.pace.restart()
        self._publish()

    def choose(self, **changes: Any) -> None:
        """Drive another course from now on; see `Course`."""
        before, self.course = self.course, replace(self.course, **changes)
        if replace(before, seed=0) != replace(self.course, seed=0):
            lanes = [Lane(self._make_env(), lane.source) for lane in self.lanes]
            for lane in self.lanes:
                lane.env.close()
            self.lanes = lanes
        self.restart()

    def pause(self, paused: bool) -> None:
        """Stand still, or go on."""
        self.paused = paused
        self.pace.restart()

    def step(self, ticks: int = 1) -> None:
        """Drive so many ticks although the drive is paused."""
        self._steps += ticks

    def set_speed(self, speed: float) -> None:
        """Drive faster or slower than real time."""
        self.pace.speed = speed
        self.pace.restart()

    def stop(self) -> None:
        """End `run`."""
        self._ends = True

    def run(self) -> None:
        """Drive until `stop`."""
        while not self._ends:
            self.turn()

    def turn(self) -> None:
        """Carry out what was ordered, then drive a tick, or wait a little where there is nothing to drive."""
        while True:
            try:
                order = self._orders.get_nowait()
            except queue.Empty:
                break
            order(self)
            self._publish()
        if self._stands:
            self._clock.sleep(_IDLE_S)
            return
        if self._steps:
            self._steps -= 1
        else:
            self.pace.wait()
        for lane in self.lanes:
            lane.tick()
        self._publish()

    @property
    def _stands(self) -> bool:
        return all(lane.ended for lane in self.lanes) or (self.paused and not self._steps)

    def _publish(self) -> None:
        first = self.lanes[0].policy
        self.frame = Frame(
            episode=self.episode,
            title=f"{self.course.course or self.course.scenario}, seed {self.course.seed}",
            plan=self.lanes[0].env.unwrapped.plan,  # type: ignore[attr-defined]
            cars=tuple(lane.frame() for lane in self.lanes),
            machine=first.definition if isinstance(first, MachinePolicy) else None,
            paused=self.paused,
            speed=self.pace.speed,
            lateness=self.pace.told,
        )

    def close(self) -> None:
        """Free what the environments hold."""
        for lane in self.lanes:
            lane.env.close()
