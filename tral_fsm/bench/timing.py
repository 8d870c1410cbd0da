"""Contestants that take turns, so that a computer that slows down slows them all.

Each figure is the median over the rounds. A warm-up and the preparation of each turn lie outside the clock.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field

from tral_env.interface import CONTROL_PERIOD_S


@dataclass(kw_only=True)
class Contestant:
    """Something whose steps are counted."""

    name: str
    step: Callable[[], int]
    """Function that steps once, and returns the number of steps that count."""
    kind: str = ""
    rows: int = 1
    """Number of cars that step together."""
    threads: int = 1
    step_s: float = CONTROL_PERIOD_S
    """Simulated time of a step, s."""
    has_workers: bool = False
    """Other processes step too, whose CPU time is not known here."""
    begin: Callable[[], None] = lambda: None
    """Called before each turn, outside the clock."""
    close: Callable[[], None] = lambda: None
    wall: list[float] = field(default_factory=list)
    """Steps per second of wall time, in each round."""
    cpu: list[float] = field(default_factory=list)
    """Steps per second of this process's CPU time, in each round."""

    def run(self, seconds: float) -> None:
        """Take a turn of at least one step."""
        self.begin()
        steps, wall, cpu = 0, time.perf_counter(), time.process_time()
        while not steps or time.perf_counter() - wall < seconds:
            steps += self.step()
        self.wall.append(steps / (time.perf_counter() - wall))
        self.cpu.append(steps / max(time.process_time() - cpu, 1e-9))

    @property
    def seconds_per_step(self) -> float:
        """Median wall time of a step that counts, s."""
        return 1.0 / statistics.median(self.wall)

    def record(self) -> dict[str, float | str | None]:
        """Medians: steps per second; simulated seconds per second of wall time, and of CPU time, if it is known."""
        wall, cpu = statistics.median(self.wall), statistics.median(self.cpu)
        return {
            "name": self.name,
            "steps_per_s": wall,
            "sim_s_per_wall_s": wall * self.step_s,
            "sim_s_per_cpu_s": None if self.has_workers else cpu * self.step_s,
        }


def take_turns(
    contestants: Sequence[Contestant],
    *,
    rounds: int,
    seconds: float,
    on_turn: Callable[[str], None] = lambda name: None,
) -> None:
    """Warm up, run all rounds, and close the contestants, also after an error.

    Args:
        contestants: the contestants, whose speeds are appended.
        rounds: number of turns of each contestant.
        seconds: time of a turn, s; the warm-up takes a quarter of it.
        on_turn: called with the name of each contestant when its turn comes.
    """
    with ExitStack() as closing:
        for contestant in reversed(contestants):
            closing.callback(contestant.close)
        for contestant in contestants:
            contestant.run(seconds / 4)
            contestant.wall.clear()
            contestant.cpu.clear()
        for _ in range(rounds):
            for contestant in contestants:
                on_turn(contestant.name)
                contestant.run(seconds)
