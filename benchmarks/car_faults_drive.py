"""The drive of `car_faults.py`: `tral deploy` as a process, with a policy and a person that commit faults."""

from __future__ import annotations

import ctypes
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve()
THROTTLE = 0.3
"""The car drives at 0.5 m/s with it."""
DRIVING_S = 2.5
"""The fault begins after so long a drive, s."""
END_S = 12.0
"""A fault has ended the pulses after this time, or the table says that it did not."""
BOARDS = ("board2016", "ucboard")
"""Serial boards: their cars have all sensors on the board."""


def raises() -> None:
    raise RuntimeError("a policy failed")


def loops() -> None:
    while True:
        pass


POLICY: dict[str, Callable[[], Any]] = {
    "exception of the policy": raises,
    "os.abort": os.abort,
    "busy loop": loops,
    "C code that holds the GIL": lambda: ctypes.PyDLL(None).sleep(60),
    "NaN action": lambda: np.array([0.0, np.nan]),
    "action of another shape": lambda: np.zeros(3),
}
"""Faults that the policy commits."""
HANDS = {
    "emergency stop on a key": "stop",
    "gamepad lost": "lost",
    "dead man's button let go": "let go",
}
"""What the person does."""


class Driver:
    """The policy: it drives straight on, and commits what the environment variable says."""

    active_states = ("straight",)

    def __init__(self) -> None:
        self._ticks = 0
        self._fault = POLICY.get(os.environ["FAULT"])

    def act(self, observation: Any) -> Any:
        """Drive, then commit the fault, once."""
        self._ticks += 1
        if self._ticks == round(DRIVING_S * 80):
            Path(os.environ["MARK"]).write_text(str(time.monotonic_ns()))
            if self._fault is not None and (answer := self._fault()) is not None:
                return answer
        return np.array([0.0, THROTTLE], np.float32)


class Person:
    """Arms at once, and does something when the mark is there."""

    name = "gamepad"

    def __init__(self) -> None:
        self._does, self._mark = HANDS.get(os.environ["FAULT"], ""), Path(os.environ["MARK"])

    def poll(self, now_s: float) -> Any:
        """What the person does."""
        from tral_env.errors import SourceLostError
        from tral_fsm.teleop.hands import Hands

        does = self._does if self._does and self._mark.exists() else ""
        if does == "lost":
            raise SourceLostError("the gamepad is gone")
        return Hands(holds=does != "let go", arm=True, stop=does == "stop")

    def close(self) -> None:
        """Do nothing."""


class Silent:
    """A console that says nothing."""

    def status(self, text: str) -> None:
        """Say nothing."""

    def say(self, text: str) -> None:
        """Say nothing."""


def drive(folder: Path) -> None:
    """Be the process that drives."""
    from tral_fsm.programs.cockpit import Cockpit
    from tral_fsm.programs.deploy import DeployArguments, run

    twin = json.loads((folder / "twin.json").read_text())
    arguments = DeployArguments(policy=f"{HERE}:Driver", config=str(folder / "car.toml"), max_duration_s=END_S + 30.0)
    cockpit = Cockpit(
        out=Path(twin["out"]), devices=[Person()], console=Silent(), must_hold=True, check=unasked,
        options={"sensors": sensors_of(twin)},
    )  # fmt: skip
    run(arguments, cockpit)


def unasked(car: Any) -> tuple[()]:
    """Ask nothing before the drive: nobody calibrated the twin."""
    return ()


def sensors_of(twin: dict[str, Any]) -> Any:
    """Sensors that a car file cannot name: a hall pin that is a socket; None: those of the car file."""
    from tral_env.hardware.camera import Camera
    from tral_env.hardware.camera_options import CameraOptions
    from tral_env.hardware.sensors import SensorGroup
    from tral_env.hardware.sonar import SonarArray
    from tral_env.twin.hall import TwinHall

    if twin["kind"] in BOARDS:
        return None
    sensors = [SonarArray(bus=twin["i2c"]), TwinHall(Path(twin["hall"]))]
    if twin["kind"] == "camera":
        sensors.append(Camera(CameraOptions(device=twin["camera"], lens=twin["lens"])))
    return SensorGroup(*sensors)


if __name__ == "__main__":
    drive(Path(sys.argv[1]))
