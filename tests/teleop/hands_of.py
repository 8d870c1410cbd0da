"""Devices that do what a test says."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from tral_env.errors import SourceLostError
from tral_fsm.teleop.hands import Hands


class Script:
    """A device whose hands are a function of the number of polls; an exception is raised."""

    def __init__(self, name: str, hands: Callable[[int], Hands | Exception]) -> None:
        self.name, self._hands, self.polls, self.closed = name, hands, 0, False

    def poll(self, now_s: float) -> Hands:
        self.polls += 1
        hands = self._hands(self.polls)
        if isinstance(hands, Exception):
            raise hands
        return hands

    def close(self) -> None:
        self.closed = True


AT_ONCE = 64
"""evdev gives no more events at once."""
LOST = SourceLostError("the pad is gone")


@dataclass
class Event:
    type: int
    code: int
    value: int


class Typed:
    """A terminal at which a test types."""

    def __init__(self) -> None:
        self.waiting = ""

    def keys(self) -> str:
        keys, self.waiting = self.waiting, ""
        return keys


class Pad:
    """What evdev shows of an XBOX pad."""

    name, path = "X-Box 360 pad", "/dev/input/event5"

    def __init__(self) -> None:
        self.waiting: list[Event] = []
        self.error: OSError | None = None
        self.closed = 0

    def absinfo(self, axis: int) -> Any:
        low, high = {0: (-32768, 32767), 2: (0, 255), 5: (0, 1023)}[axis]
        return SimpleNamespace(min=low, max=high)

    def read(self) -> Iterator[Event]:
        """As evdev does it: the error comes when the first event is taken."""
        if self.error is not None:
            raise self.error
        if not self.waiting:
            raise BlockingIOError
        events, self.waiting = self.waiting[:AT_ONCE], self.waiting[AT_ONCE:]
        yield from events

    def close(self) -> None:
        self.closed += 1


@contextmanager
def pseudo_terminal() -> Iterator[tuple[int, int]]:
    """Both ends of a terminal: that of the person, and that of the program."""
    person, program = os.openpty()
    try:
        yield person, program
    finally:
        for end in (person, program):
            try:
                os.close(end)
            except OSError:
                continue
