"""What tests of the twin share: a clock that runs by hand, and a twin that drives by it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tral_env.interface import CONTROL_PERIOD_S
from tral_env.twin.settings import TwinSettings
from tral_env.twin.twin import Twin


class Clock:
    """Time that passes by sleeping alone."""

    def __init__(self) -> None:
        self.now = 100.0
        self.passes: Callable[[float], None] = lambda now: None

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now = min(self.now + CONTROL_PERIOD_S, end)
            self.passes(self.now)


def twin_by_hand(**settings: Any) -> tuple[Twin, Clock]:
    """A twin without files whose ticks come as its clock passes; edges of its hall sensor gather in `twin.heard`."""
    clock = Clock()
    twin = Twin(TwinSettings(files=False, serial=False, **settings), clock, clock.sleep)
    due = [clock.now + CONTROL_PERIOD_S]
    twin.heard = []  # type: ignore[attr-defined]

    def tick_until(now: float) -> None:
        while due[0] <= now:
            twin.heard.extend(twin.tick(due[0]))  # type: ignore[attr-defined]
            due[0] += CONTROL_PERIOD_S

    clock.passes = tick_until
    return twin, clock
