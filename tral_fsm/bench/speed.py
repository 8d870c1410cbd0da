"""Steps per second of several environments, side by side in one run.

A step is one control period of 12.5 ms of one car; a step in which an environment only resets does not count.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from tral_env.errors import RenderError
from tral_fsm.bench.bare import bare_batch, bare_drive, bare_loop
from tral_fsm.bench.costs import camera_cost, reset_cost, size_cost
from tral_fsm.bench.environments import landmark, native, rival, single
from tral_fsm.bench.plan import SpeedPlan
from tral_fsm.bench.shares import share_cost
from tral_fsm.bench.startup import startup_cost
from tral_fsm.bench.timing import Contestant, take_turns
from tral_fsm.evaluation.host import host

Skipped = list[dict[str, str]]
"""What could not be measured: ``name`` and ``reason`` of each."""


def contestants(plan: SpeedPlan) -> tuple[list[Contestant], Skipped]:
    """All contestants, and the landmarks that lack a package."""
    field = [
        bare_loop(plan.scenario),
        bare_drive(plan.scenario),
        single(plan.scenario),
        rival(plan.scenario, plan.rivals, "sync"),
        rival(plan.scenario, plan.rivals, "async"),
    ]
    for rows in plan.rows:
        for threads in plan.threads:
            if rows == 1 and threads != plan.threads[0]:
                continue  # more threads do not help one row
            field += [native(plan.scenario, rows, threads), bare_batch(plan.scenario, rows, threads)]
        if rows == plan.compared and 1 < plan.threads[-1] <= rows:
            field.append(native(plan.scenario, rows, 1, processes=plan.threads[-1]))
    skipped = []
    for name in plan.landmarks:
        try:
            field.append(landmark(name))
        except ImportError as error:  # the MuJoCo environments of Gymnasium need imageio
            skipped.append({"name": name, "reason": str(error)})
    return field, skipped


def measure(plan: SpeedPlan, on_round: Callable[[str], None] = lambda name: None) -> dict[str, Any]:
    """Measure all contestants.

    Args:
        plan: what to measure, and for how long.
        on_round: called with the name of each contestant when its turn comes.

    Returns:
        ``host``, ``plan``; ``contestants`` with their records; ``ratios`` by name; ``reset_ms_per_row`` with a new
        course of the family ``reset_scenario``, ``reset_ms_per_row_kept`` with a kept one; ``shares`` of a step;
        ``startup``, ``camera``, ``course_size``; ``skipped``: name and reason of what could not be measured.
    """
    field, skipped = contestants(plan)
    take_turns(field, rounds=plan.rounds, seconds=plan.seconds, on_turn=on_round)
    resets = reset_cost(plan.scenario)
    camera = None
    try:
        camera = camera_cost() if plan.camera else None
    except RenderError as error:
        skipped.append({"name": "rendered camera", "reason": str(error)})
    return {
        "host": host(),
        "plan": asdict(plan),
        "contestants": [contestant.record() for contestant in field],
        "ratios": ratios(field, plan),
        "reset_scenario": plan.scenario,
        "reset_ms_per_row": resets["new"],
        "reset_ms_per_row_kept": resets["kept"],
        "shares": share_cost(plan.scenario, plan.compared),
        "startup": startup_cost(plan.scenario),
        "camera": camera,
        "course_size": size_cost() if plan.sizes else None,
        "skipped": skipped,
    }


def ratios(field: Sequence[Contestant], plan: SpeedPlan) -> dict[str, float]:
    """Medians of the ratios of two contestants, round by round."""
    ours, bare = _one(field, "native", plan.compared), _one(field, "bare batch", plan.compared)
    split = [each for each in field if each.kind == "processes"]
    pairs = {
        "single_over_bare_loop": (_one(field, "single"), _one(field, "bare loop")),
        "single_over_bare_drive": (_one(field, "single"), _one(field, "bare drive")),
        "vector_over_bare_batch": (ours, bare),
        **({"processes_over_bare_batch": (split[0], bare)} if split else {}),
        "vector_over_sync": (ours, _one(field, "sync", plan.rivals)),
        "vector_over_async": (ours, _one(field, "async", plan.rivals)),
    }
    if plan.scaling is not None:
        many, few = plan.scaling
        pairs[f"rows_{many}_over_{few}"] = _one(field, "native", many), _one(field, "native", few)
    return {
        name: statistics.median(a / b for a, b in zip(one.wall, other.wall, strict=True))
        for name, (one, other) in pairs.items()
    }


def _one(field: Sequence[Contestant], kind: str, rows: int = 1) -> Contestant:
    """The contestant of a kind with these rows, and the last number of threads that it was measured with."""
    return [each for each in field if (each.kind, each.rows) == (kind, rows)][-1]
