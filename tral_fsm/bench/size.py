"""Cost of larger courses: the same cars in corridors with more and more walls."""

from __future__ import annotations

import statistics
import time
from typing import Any

import mujoco
import numpy as np
from gymnasium.utils import seeding

from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Door, Segment
from tral_env.world import CorridorConfig, World

DOORS = (0, 4, 49)
"""Numbers of doors on each side of a straight corridor, 2.5 m apart: 4, 36 and about 400 boxes."""
_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)


def corridor(doors: int) -> Course:
    """A straight corridor with a number of doors on each side."""
    placed = tuple(Door(side=side, at=4.0 + 2.5 * i) for i in range(doors) for side in ("left", "right"))
    return Course(name=f"{doors} doors", segments=(Segment(length=max(20.0, 8.0 + 2.5 * doors), doors=placed),))


def size_cost(rows: int = 64, ticks: int = 40, rounds: int = 3) -> list[dict[str, Any]]:
    """Cost of a step over the number of boxes, on one thread.

    Returns:
        For each course ``boxes``, and the time of a control step of a car, us: ``step_us`` in the corridor,
        ``bare_us`` of `Batch.step` alone.
    """
    fields: list[tuple[int, World, list[float], list[float]]] = []
    for doors in DOORS:
        course = corridor(doors)
        world = World(rows, CorridorConfig(course=course))
        world.reset(np.arange(rows), [seeding.np_random(i)[0] for i in range(rows)])
        fields.append((len(build_plan(course).box_kind), world, [], []))
    command = np.tile([0.0, 0.4], (rows, 1))
    for _ in range(rounds):
        for _, world, steps, bare in fields:
            start = time.perf_counter()
            for _ in range(ticks):
                world.step(command)
            middle = time.perf_counter()
            for _ in range(ticks):
                world.sim.batch.step(nstep=world.sim.substeps, stage=_VEL)
            steps.append((middle - start) / ticks / rows * 1e6)
            bare.append((time.perf_counter() - middle) / ticks / rows * 1e6)
    return [
        {"boxes": boxes, "step_us": statistics.median(steps), "bare_us": statistics.median(bare)}
        for boxes, _, steps, bare in fields
    ]
