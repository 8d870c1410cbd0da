"""A running twin as something that a page can show: it asks, and changes nothing."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np

from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course as CourseFile
from tral_env.course.plan import Plan
from tral_env.errors import HardwareError
from tral_env.twin.control import ControlConnection
from tral_fsm.live.frame import CarFrame, Frame

ASKS_HZ = 20.0


class TwinView:
    """Asks a twin how its car stands, until the twin ends."""

    def __init__(self, folder: Path) -> None:
        """Look once.

        Args:
            folder: of the twin's files.

        Raises:
            HardwareError: no twin answers there.
        """
        self._name, self._line = folder.name, ControlConnection(folder)
        self._seed, self._episode = -1, 0
        self._time_s = 0.0
        self._plan: Plan | None = None
        self._ended = threading.Event()
        self.look()

    def look(self) -> None:
        """Ask once; a twin that was reset has another course."""
        told = self._line.ask(do="look")
        time_s = float(told["truth"]["time_s"])
        if told["seed"] != self._seed or time_s < self._time_s:
            self._seed, self._episode = told["seed"], self._episode + 1
            self._plan = build_plan(CourseFile.parse(self._line.ask(do="course")))
        self._time_s = time_s
        self.frame = Frame(
            episode=self._episode,
            title=f"{self._name}, seed {self._seed}",
            plan=self._plan,
            cars=(_car(told),),
            lateness=f"the twin has lost {told['lost_s']:.1f} s" if told["lost_s"] > 0.0 else "",
            notice=_notice(told),
        )

    def run(self, seconds: float | None = None) -> None:
        """Ask again and again until the twin ends, `close` is called, or so long."""
        ticks = 0
        while not self._ended.wait(1.0 / ASKS_HZ) and (seconds is None or ticks < seconds * ASKS_HZ):
            ticks += 1
            try:
                self.look()
            except HardwareError:
                return

    def close(self) -> None:
        """Disconnect."""
        self._ended.set()
        self._line.close()


def _car(told: dict[str, Any]) -> CarFrame:
    truth, readings = told["truth"], told["readings"]
    outcome = told["outcome"]
    return CarFrame(
        name="whoever drives the devices",
        time_s=float(truth["time_s"]),
        readings=readings,
        action=(float(readings["steering"]), float(readings["throttle"])),
        pose=(truth["x"], truth["y"], truth["yaw"]),
        qpos=np.array(told["qpos"]),
        speed_mps=float(truth["speed_mps"]),
        gates=(int(truth["gates_passed"]), int(truth["gates_total"])),
        progress=float(truth["progress"]),
        ended="" if outcome is None else str(outcome["ended"]),
    )


def _notice(told: dict[str, Any]) -> str:
    """What a person should know of the twin."""
    words = [
        *([f"the twin stands still: {told['failure']}"] if told["failure"] else []),
        *([f"faults: {', '.join(told['faults'])}"] if told["faults"] else []),
        *([] if told["armed"] else ["the motor controller is not armed"]),
    ]
    return "; ".join(words)
