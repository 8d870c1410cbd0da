"""What a step of a row takes: the share that threads can divide among them, and the share that they cannot."""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np

from tral_env.options import CorridorConfig
from tral_env.world import World
from tral_fsm.bench.commands import gentle
from tral_fsm.bench.costs import start_rows

CORES = (4, 8, 16)
"""Numbers of cores to which the speed is extrapolated."""


class _Clocked:
    """A batch whose steps are timed."""

    def __init__(self, batch: Any) -> None:
        self._batch, self.seconds = batch, 0.0

    def step(self, *arguments: Any, **options: Any) -> None:
        """Step, and add the time of this thread."""
        begin = time.thread_time()
        self._batch.step(*arguments, **options)
        self.seconds += time.thread_time() - begin

    def __getattr__(self, name: str) -> Any:
        return getattr(self._batch, name)


def share_cost(scenario: str, rows: int, *, ticks: int = 40) -> dict[str, Any]:
    """Time of this thread in a step of the native cars, us for a row: medians over ticks, without resets.

    Args:
        scenario: family of the courses.
        rows: number of cars.
        ticks: number of steps.

    Returns:
        ``rows``; ``physics_us``, which any number of threads can divide; ``serial_us``, which none can take;
        ``extrapolated_steps_per_s``: cores -> ``1 / (serial + physics / cores)``. Memory and clock of a processor with
        all its cores at work are not in it: it is extrapolated, not measured.
    """
    world, rng = World(rows, CorridorConfig(scenario=scenario)), np.random.default_rng(0)
    start_rows(world)
    batch = _Clocked(world.sim.physics.batch)
    world.sim.physics.batch = batch
    physics, serial = [], []
    for _ in range(ticks):
        batch.seconds, command, begin = 0.0, gentle(rows, rng), time.thread_time()
        world.step(command)
        serial.append(time.thread_time() - begin - batch.seconds)
        physics.append(batch.seconds)
    world.close()
    physics_us, serial_us = (1e6 * statistics.median(times) / rows for times in (physics, serial))
    return {
        "rows": rows,
        "physics_us": physics_us,
        "serial_us": serial_us,
        "extrapolated_steps_per_s": {cores: 1e6 / (serial_us + physics_us / cores) for cores in CORES},
    }
