"""A car without devices, on a clock that passes only by sleeping, and a person with a script."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tral_fsm.programs.cockpit import Cockpit
from tral_fsm.teleop.hands import Hands


class Clock:
    """Time that passes only by sleeping."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class Rolling:
    """Sensors of a car that rolls at 0.5 m/s from its start on, with walls at its sides; `change` alters readings."""

    provided_readings = frozenset(
        {"distance", "speed", "battery"}
        | {f"ultrasonic_{side}{what}" for side in ("left", "front", "right") for what in ("", "_age")}
    )

    def __init__(self, change: Callable[[float, dict[str, float]], Mapping[str, float]] | None = None) -> None:
        self._change, self._start = change, 0.0
        self._now = 0.0

    def start(self) -> None:
        self._start = self._now

    def read(self, now: float) -> Mapping[str, float]:
        self._start = self._start or now
        self._now, driven = now, now - self._start
        readings = {"distance": driven * 0.5 // 0.025 * 0.025, "speed": 0.5, "battery": 7.6}
        for side, metres in (("left", 1.0), ("front", 4.0), ("right", 0.8)):
            readings[f"ultrasonic_{side}"] = metres + 0.01 * (driven // 0.07 % 2)
            readings[f"ultrasonic_{side}_age"] = driven % 0.07
        return readings if self._change is None else self._change(driven, readings)

    def stop(self) -> None:
        pass


class Words:
    """A console that keeps what it is told."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.shown: list[str] = []

    def status(self, text: str) -> None:
        self.shown.append(text)

    def say(self, text: str) -> None:
        self.said.append(text)


class Person:
    """A device: arms once the drive asks for that, and does at a time what a test says."""

    def __init__(
        self, then: Callable[[float], Hands | Exception] = lambda now: Hands(), name: str = "keyboard"
    ) -> None:
        self.name, self._then, self._armed_s, self._was_asked = name, then, -1.0, False

    def poll(self, now_s: float) -> Hands:
        if not self._was_asked:  # the poll before the prompt
            self._was_asked = True
            return Hands()
        if self._armed_s < 0.0:
            self._armed_s = now_s
            return Hands(arm=True, holds=True)
        hands = self._then(now_s - self._armed_s)
        if isinstance(hands, Exception):
            raise hands
        return hands

    def close(self) -> None:
        pass


def cockpit(folder: Path, *devices: Person, sensors: Rolling | None = None, **more: Any) -> Cockpit:
    """What a drive has around it: a clock that passes by sleeping, and sensors in place of the devices of a car."""
    clock = Clock()
    options = more.pop("options", {}) | ({} if sensors is None else {"sensors": sensors})
    around = {"console": Words(), "clock": clock, "sleep": clock.sleep} | more
    return Cockpit(out=folder / "out", devices=devices, options=options, **around)
