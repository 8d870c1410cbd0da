"""Sensitivity of the cost around a machine: over a plane of two parameters, and along each parameter alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.tuning.evaluator import Evaluator, SeededCourse, StageName
from tral_fsm.tuning.landscape import CostLine, CostPlane, Sensitivity
from tral_fsm.tuning.objective import Objective
from tral_fsm.tuning.parameters import Parameter, Value, allowed, apply
from tral_fsm.tuning.search.space import from_unit

Array = NDArray[np.float64]
Axis = tuple[Parameter, Array]
"""A parameter and its values on the grid, (size,)."""


def sensitivity(
    evaluator: Evaluator,
    machine: MachineDefinition,
    parameters: Sequence[Parameter],
    values: Sequence[Value],
    courses: Sequence[SeededCourse],
    objective: Objective,
    *,
    size: int = 9,
) -> Sensitivity:
    """Drive a grid over the first two real parameters and a line along each one, all in one batch.

    Args:
        evaluator: the evaluator of the drives.
        machine: the machine that was found.
        parameters: the parameters of the search.
        values: their values in the machine.
        courses: the courses of each point.
        objective: the cost.
        size: number of points along a side and along a line.
    """
    real = [k for k, each in enumerate(parameters) if each.kind == "float"]
    spread = {k: [from_unit(parameters[k], place) for place in np.linspace(0.0, 1.0, size)] for k in real}
    grid: list[dict[int, float]] = []
    if len(real) > 1:
        grid = [{real[0]: x, real[1]: y} for y in spread[real[1]] for x in spread[real[0]]]
    lines = [{k: value} for k in real for value in spread[k]]
    points = [[point.get(k, value) for k, value in enumerate(values)] for point in [*grid, *lines]]
    fitting = [k for k, point in enumerate(points) if allowed(machine, parameters, point)]
    evaluator.stage(StageName.AROUND, len(fitting) * len(courses))
    drives = evaluator.on_courses([apply(machine, parameters, points[k]) for k in fitting], courses)
    figures = {name: np.full(len(points), np.nan) for name in ("cost", "failed", "collided")}
    figures["cost"][fitting] = [objective.cost(mine) for mine in drives]
    figures["failed"][fitting] = [np.mean([not drive.success for drive in mine]) for mine in drives]
    figures["collided"][fitting] = [np.mean([drive.outcome == "collision" for drive in mine]) for mine in drives]
    axes = [(parameters[k], np.array(spread[k])) for k in real]
    on_plane = {name: values[: len(grid)] for name, values in figures.items()}
    on_lines = {name: values[len(grid) :].reshape(-1, size) for name, values in figures.items()}
    plane = _plane(axes[0], axes[1], on_plane) if grid else None
    return Sensitivity(plane=plane, lines=_lines(axes, on_lines), courses=len(courses))


def _plane(x: Axis, y: Axis, figures: Mapping[str, Array]) -> CostPlane:
    """Plane of two axes, from figures of its points in rows along x."""
    shaped = {name: values.reshape(len(y[1]), len(x[1])) for name, values in figures.items()}
    return CostPlane(x=x[0], y=y[0], xs=x[1], ys=y[1], **shaped)


def _lines(axes: Sequence[Axis], figures: Mapping[str, Array]) -> list[CostLine]:
    """Line along each axis, from figures with a row for each."""
    return [
        CostLine(parameter=parameter, values=values, cost=cost, failed=failed)
        for (parameter, values), cost, failed in zip(axes, figures["cost"], figures["failed"], strict=True)
    ]
