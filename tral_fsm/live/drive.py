"""A drive that goes on by itself, is watched through frames, and is changed by orders between two ticks."""

from __future__ import annotations

import contextlib
import math
import queue
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tral_env.errors import RenderError
from tral_fsm.evaluation.own_policy import find_policy
from tral_fsm.live.frame import Course, Frame
from tral_fsm.live.ghost import Ghosts
from tral_fsm.live.hands import Keys
from tral_fsm.live.lane import FAULTS, Find, Lane, words_of
from tral_fsm.live.pace import Clock, Pace
from tral_fsm.runtime.policy import MachinePolicy

_IDLE_S = 0.02
"""A drive that stands looks for orders so often."""
_FRAME_S = 0.02
"""A frame is made so often at the most: pages look 25 times a second."""
_PICTURE_TICKS = 16
"""A picture of the camera is offered so often: five a second."""
PICTURE = 320, 240
"""Width and height of the camera's picture, px."""


Order = Callable[["LiveDrive"], None]


class LiveDrive:
    """Cars on one course, each with its driver.

    Orders come from any thread, and the thread that drives carries them out between two ticks, in their order. Any
    thread reads `frame`. So a page that is slow, or gone, changes nothing.
    """

    def __init__(
        self,
        course: Course,
        drivers: Sequence[str],
        *,
        clock: Clock | None = None,
        find: Find = find_policy,
        keys: Keys | None = None,
        warn: Callable[[str], None] | None = None,
    ) -> None:
        """Put the cars at the start.

        Args:
            course: what is driven.
            drivers: names or paths of the policies, one for each car.
            clock: how time is told and waited for.
            find: gives a policy by its name.
            keys: keys that a person presses in the page.
            warn: is told of a driver that failed, in a line.

        Raises:
            TralError: an unknown name, or a policy that cannot drive.
        """
        self.course, self.find, self.keys, self._warn = course, find, keys or Keys(), warn
        self._clock = clock or Clock()
        self.pace = Pace(self._clock)
        self._orders: queue.SimpleQueue[Order] = queue.SimpleQueue()
        self._ends, self._steps, self._ticks = False, 0, 0
        self.paused, self.episode, self.notice = False, 0, ""
        self.shows_camera = True
        """Whether pictures of the camera are offered."""
        self._picture: Callable[[], NDArray[np.uint8]] | None = None
        self._ghosts = Ghosts()
        self.lanes = self._started(drivers)
        self._begin()

    def _started(self, drivers: Sequence[str]) -> list[Lane]:
        """Cars at the start of the course; if one of them cannot be, nothing stays open."""
        with contextlib.ExitStack() as stack:
            lanes = []
            for driver in drivers:
                env = self._env()
                stack.callback(env.close)
                lanes.append(Lane(env, driver, self.find, self._stand_for))
            for lane in lanes:
                lane.start(self.course.seed)
            stack.pop_all()
        return lanes

    def _env(self) -> gym.Env[Any, Any]:
        course = self.course
        return gym.make(
            "tral_env:TralCorridor-v0",
            scenario=course.scenario,
            course=course.course,
            camera=course.camera,
            randomization=course.randomization,
        )

    def _stand_for(self, failure: str) -> None:
        """Pause because a driver failed, so that a person can choose another one."""
        self._steps = 0
        self.pause(True)
        if self._warn is not None:
            self._warn(failure)

    def order(self, what: Order) -> None:
        """Have something done between two ticks, by the thread that drives."""
        self._orders.put(what)

    def restart(self) -> None:
        """Put all cars at the start of the course."""
        for lane in self.lanes:
            lane.restart(self.course.seed)
        self._begin()

    def _begin(self) -> None:
        """Count a drive that begins."""
        self.episode += 1
        self._ghosts.begin(self.course)
        self._picture = None
        self.pace.restart()
        self._publish()

    def choose(self, **changes: Any) -> None:
        """Drive another course from now on; see `Course`.

        Raises:
            TralError: there is no such course; the old one is driven on.
        """
        before = self.course
        try:
            self.course = replace(before, **changes)
            if replace(before, seed=0) == replace(self.course, seed=0):
                self.restart()
            else:
                self.drive_with([lane.driver for lane in self.lanes])
        except FAULTS:
            self.course = before
            raise

    def drive_with(self, drivers: Sequence[str]) -> None:
        """Let these policies drive side by side, from the start.

        Raises:
            TralError: one of them cannot; the old ones drive on.
        """
        before, self.lanes = self.lanes, self._started(drivers)
        for lane in before:
            lane.close()
        self._begin()

    def each(self, what: Callable[[Lane], None]) -> None:
        """Do the same with every car."""
        for lane in self.lanes:
            what(lane)

    def pause(self, paused: bool) -> None:
        """Stand still, or go on."""
        self.paused = paused
        self.pace.restart()

    def step(self, ticks: int = 1) -> None:
        """Drive so many ticks although the drive is paused."""
        self._steps += ticks

    def set_speed(self, speed: float) -> None:
        """Drive faster or slower than real time; `inf`: as fast as it goes."""
        self.pace.speed = speed
        self.pace.restart()

    def stop(self) -> None:
        """End `run`."""
        self._ends = True

    def run(self, seconds: float | None = None) -> None:
        """Drive until `stop`, or for so long on the clock."""
        until = math.inf if seconds is None else self._clock.now() + seconds
        while not self._ends and self._clock.now() < until:
            self.turn()

    def turn(self) -> None:
        """Carry out what was ordered; then drive a tick, or wait a little where there is nothing to drive."""
        self._obey()
        if self._stands:
            self._clock.sleep(_IDLE_S)
            self.pace.restart()
            return
        if self._steps:
            self._steps -= 1
        else:
            self.pace.wait()
        for lane in self.lanes:
            lane.tick()
        self._ghosts.note(self.lanes)
        self._ticks += 1
        if self.shows_camera and self._ticks % _PICTURE_TICKS == 0:
            self._look()
        if self._stands or self._clock.now() >= self._shown_until:
            self._publish()

    def _obey(self) -> None:
        while not self._orders.empty():
            order = self._orders.get()
            try:
                self.notice = ""
                order(self)
            except FAULTS as error:
                self.notice = words_of(error)
            self._publish()

    @property
    def _stands(self) -> bool:
        return all(lane.ended for lane in self.lanes) or (self.paused and not self._steps)

    def _look(self) -> None:
        try:
            self._picture = self.lanes[0].look(*PICTURE)
        except RenderError as error:
            self.notice, self.shows_camera = str(error), False

    def _publish(self) -> None:
        self._shown_until = self._clock.now() + _FRAME_S
        first = self.lanes[0]
        machine = first.policy.definition if isinstance(first.policy, MachinePolicy) else None
        cars = tuple(lane.frame() for lane in self.lanes)
        self.frame = Frame(
            episode=self.episode,
            title=f"{self.course.course or self.course.scenario}, seed {self.course.seed}",
            plan=first.world.plans[0],
            cars=cars,
            machine=machine,
            as_loaded=None if machine is None else first.as_loaded,
            ghost=self._ghosts.at(cars[0].time_s),
            paused=self.paused,
            speed=self.pace.speed,
            lateness=self.pace.told,
            course=self.course,
            parameters=first.parameters(),
            notice=self.notice,
            picture=self._picture,
        )

    def close(self) -> None:
        """Free what the environments hold."""
        for lane in self.lanes:
            lane.close()
