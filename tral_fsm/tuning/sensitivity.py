"""What lies around a machine that was found: the cost over a plane of two parameters, and along each one alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.tuning.evaluator import Course, Evaluator
from tral_fsm.tuning.landscape import Line, Plane
from tral_fsm.tuning.objective import Objective
from tral_fsm.tuning.parameters import Parameter, Value, allowed, apply
from tral_fsm.tuning.search.space import from_unit


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """What lies around."""

    plane: Plane | None
    lines: list[Line]
    courses: int
    """Each point has driven so many."""


def sensitivity(
    evaluator: Evaluator,
    machine: MachineDefinition,
    parameters: Sequence[Parameter],
    values: Sequence[Value],
    courses: Sequence[Course],
    objective: Objective,
    *,
    size: int = 9,
) -> Sensitivity:
    """Drive a grid over the first two real parameters and a line along each, all in one batch.

    Args:
        evaluator: drives.
        machine: with its own values.
        parameters: what was searched.
        values: what was found.
        courses: each point drives all of them.
        objective: of the cost.
        size: points along a side and along a line.
    """
    real = [k for k, each in enumerate(parameters) if each.kind == "float"]
    spread = {k: [from_unit(parameters[k], place) for place in np.linspace(0.0, 1.0, size)] for k in real}
    grid: list[dict[int, float]] = []
    if len(real) > 1:
        grid = [{real[0]: x, real[1]: y} for y in spread[real[1]] for x in spread[real[0]]]
    lines = [{k: value} for k in real for value in spread[k]]
    points = [[point.get(k, value) for k, value in enumerate(values)] for point in [*grid, *lines]]
    fitting = [k for k, point in enumerate(points) if allowed(machine, parameters, point)]
    evaluator.stage("around", len(fitting) * len(courses))
    drives = evaluator.on_courses([apply(machine, parameters, points[k]) for k in fitting], courses)
    cost, failed, collided = (np.full(len(points), np.nan) for _ in range(3))
    cost[fitting] = [objective.cost(mine) for mine in drives]
    failed[fitting] = [np.mean([not drive.success for drive in mine]) for mine in drives]
    collided[fitting] = [np.mean([drive.outcome == "collision" for drive in mine]) for mine in drives]
    count = len(grid)
    plane = None
    if count:
        x, y = real[:2]
        plane = Plane(
            x=parameters[x],
            y=parameters[y],
            xs=np.array(spread[x]),
            ys=np.array(spread[y]),
            **{
                name: part[:count].reshape(size, size)
                for name, part in (("cost", cost), ("failed", failed), ("collided", collided))
            },
        )
    along = [
        Line(
            parameter=parameters[k],
            values=np.array(spread[k]),
            cost=cost[begin : begin + size],
            failed=failed[begin : begin + size],
        )
        for begin, k in zip(range(count, len(cost), size), real, strict=True)
    ]
    return Sensitivity(plane=plane, lines=along, courses=len(courses))
