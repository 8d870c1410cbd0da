"""Gates that are too close, beside the view, or one after the other, and what the machines pass them with."""

from typing import Any

import numpy as np
import pytest

from tral_env.course.layout import Course
from tral_env.options import CorridorConfig
from tral_env.world import World
from tral_fsm import load_policy


def outcomes(machine: str, width: float, length: float, *gates: dict[str, Any], rows: int = 8) -> list[str]:
    """How drives of faulty cars end on a straight corridor with gates."""
    gates = tuple({"id": k, **gate} for k, gate in enumerate(gates))
    segment = {"length": length, "width": width, "gates": gates}
    course = Course.model_validate({"name": "tight", "segments": [segment]})
    world = World(rows, CorridorConfig(course=course))
    world.reset(world.request(np.arange(rows)), [np.random.default_rng(seed) for seed in range(rows)])
    policy, driving = load_policy(machine), np.ones(rows, bool)
    policy.reset(rows)
    observation, ends = world.observation(), ["" for _ in range(rows)]
    while driving.any():
        step = world.step(policy.act(observation), np.flatnonzero(driving))
        observation = step.observation
        for row in np.flatnonzero(driving & (step.terminated | step.truncated)):
            info = {key: bool(step.info[key][row]) for key in ("success", "collision", "missed_gate")}
            ends[row] = next((key for key, holds in info.items() if holds), "time is up")
        driving &= ~(step.terminated | step.truncated)
    return ends


# The manoeuvre of 2016 drives its last metre straight on, whatever it sees then.
@pytest.mark.parametrize(("machine", "least"), [("gate_scurve", 8), ("gate", 6)])
def test_a_gate_so_close_that_only_one_post_is_in_view_is_passed(machine: str, least: int) -> None:
    ends = outcomes(machine, 3.0, 8.0, {"at": 2.5, "width": 0.6, "offset": 0.3})
    assert ends.count("success") >= least


# 59 and 55 of 60.
@pytest.mark.parametrize(("machine", "least"), [("gate_scurve", 7), ("gate", 6)])
def test_a_gate_beside_the_view_is_passed(machine: str, least: int) -> None:
    ends = outcomes(machine, 3.0, 8.0, {"at": 3.0, "width": 0.8, "offset": 0.6})
    assert ends.count("success") >= least


def test_gates_to_and_fro_are_mostly_passed() -> None:
    zigzag = [{"at": 4.0 + 3.3 * k, "width": 0.7, "offset": 0.7 * (-1) ** k} for k in range(3)]
    assert outcomes("gate_scurve", 2.6, 14.0, *zigzag).count("success") >= 6
