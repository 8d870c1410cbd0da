"""Drives for the report of a search: the cost around its result, and steps in the wanted clearance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.cluster import Workers
from tral_fsm.tuning.classical.design import Gains, lqr
from tral_fsm.tuning.classical.experiments import relay, step, wall_gains
from tral_fsm.tuning.classical.loops import Response
from tral_fsm.tuning.evaluator import Evaluator, OnStage, Stage, StageName, Task
from tral_fsm.tuning.found import Tuned
from tral_fsm.tuning.landscape import CostPlane, Sensitivity
from tral_fsm.tuning.objective import Objective
from tral_fsm.tuning.page_data import PageData, WallLoops
from tral_fsm.tuning.parameters import Parameter
from tral_fsm.tuning.sensitivity import sensitivity

MAX_LINES = 12
"""Number of parameters with a plot of their own. Source: choice; four rows of three plots."""
MIN_COURSES = 4
"""Number of courses for each point; with more scenarios one course of each. Source: choice."""


def examples(
    tuned: Tuned,
    task: Task,
    objective: Objective,
    *,
    command: str,
    version: str,
    processes: Workers = 1,
    size: int = 9,
    on_stage: OnStage | None = None,
) -> PageData:
    """Drive all that the report shows beside the search itself.

    Args:
        tuned: result of the search.
        task: task of the search.
        objective: the cost.
        command: command line of the search.
        version: version of tral-env.
        processes: number of processes, or address of a Dask scheduler.
        size: number of points along a side of the plane and along a line; 0 or 1: neither is driven.
        on_stage: called with the progress of the stages "around", drives around the result, and "steps", responses.
    """
    return PageData(
        tuned=tuned,
        scenarios=task.scenarios,
        seeds=task.seeds,
        randomization=task.randomization,
        pooling=objective.pooling,
        command=command,
        version=version,
        sensitivity=_sensitivity(tuned, task, objective, processes, size, on_stage) if size > 1 else None,
        loops=_wall_loops(tuned, on_stage),
    )


def _sensitivity(
    tuned: Tuned, task: Task, objective: Objective, processes: Workers, size: int, on_stage: OnStage | None
) -> Sensitivity | None:
    values = [each.before for each in tuned.parameters] if tuned.values is None else list(tuned.values)
    real = real_parameters(tuned.parameters)[:MAX_LINES]
    if not real:
        return None
    with Evaluator(task, processes=processes, on_stage=on_stage) as evaluator:
        found = sensitivity(
            evaluator,
            tuned.new,
            [tuned.parameters[k] for k in real],
            [values[k] for k in real],
            task.courses[: max(MIN_COURSES, len(task.scenarios))],
            objective,
            size=size,
        )
    return found if found.plane is None else replace(found, landmarks=_landmarks(tuned.new, found.plane))


def real_parameters(parameters: Sequence[Parameter]) -> list[int]:
    """Indices of the real parameters; p and d of one state come first, if a state has both."""
    real = [k for k, each in enumerate(parameters) if each.kind == "float"]
    places = {(each.sites[0].name, each.sites[0].place[:-1]): k for k, each in enumerate(parameters)}
    for k in real:
        site = parameters[k].sites[0]
        other = places.get(("d", site.place[:-1]))
        if site.name == "p" and other is not None:
            return [k, other, *(each for each in real if each not in (k, other))]
    return real


def _landmarks(machine: MachineDefinition, plane: CostPlane) -> dict[str, tuple[float, float]]:
    """Classical gains, if the plane is that of p and d of a state that follows a wall."""
    first, second = plane.x.sites[0], plane.y.sites[0]
    state = next((each for each in wall_gains(machine) if each.place == first.place[:-1]), None)
    if (first.name, second.name) != ("p", "d") or state is None:
        return {}
    gains = lqr(state.speed)
    marks = {f"LQR at {state.speed:.3g} m/s": (gains.p, gains.d)}
    swing = relay(state.speed)
    if swing is not None:
        gains = swing.ziegler_nichols()
        marks["Ziegler-Nichols"] = gains.p, gains.d
    return marks


def _wall_loops(tuned: Tuned, on_stage: OnStage | None) -> WallLoops | None:
    """Responses of the first wall following state whose parameters have changed, else of the first one."""
    pairs = list(zip(wall_gains(tuned.old), wall_gains(tuned.new), strict=False))
    if not pairs:
        return None
    old, new = next((pair for pair in pairs if pair[0] != pair[1]), pairs[0])
    gains: dict[str, tuple[Gains, float]] = {"was": (old.gains, old.speed), "now": (new.gains, new.speed)}
    gains["LQR"] = (lqr(new.speed), new.speed)
    return WallLoops(state=new.name, responses=_responses(gains, on_stage))


def _responses(
    gains: dict[str, tuple[Gains, float]], on_stage: OnStage | None
) -> dict[str, tuple[Gains, float, Response]]:
    found: dict[str, tuple[Gains, float, Response]] = {}
    driven: dict[tuple[Gains, float], Response] = {}
    stage = Stage(name=StageName.STEPS, done=0, total=len(gains), unit="responses")
    for name, (each, speed) in gains.items():
        if on_stage is not None:
            on_stage(replace(stage, done=len(found)))
        if (each, speed) not in driven:  # a machine that was kept has the same gains twice
            driven[each, speed] = step(each, speed)
        found[name] = each, speed, driven[each, speed]
    if on_stage is not None:
        on_stage(replace(stage, done=len(found)))
    return found
