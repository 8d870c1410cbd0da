"""Every reference machine drives what it is made for, a few courses of the simulation each, with faulty cars."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import tral_env
from tral_env.course.layout import Course
from tral_env.options import CorridorConfig
from tral_env.world import World
from tral_fsm import load_machine, load_policy, machine_names
from tral_fsm.evaluation.batch import BatchRunner
from tral_fsm.evaluation.episode import EpisodeRequest
from tral_fsm.states.fsm_state import FSMStateSpec

FAMILY_OF = {
    "wall": "straight",
    "corridor": "straight",
    "doors": "doors",
    "corners": "corners",
    "loop": "loop",
    "lane_change": "lane_change",
    "obstacles": "obstacles",
    "gate": "gates",
    "gate_scurve": "gates",
    "crossing": "crossing",
}
SEEDS = (1, 2, 3)
"""Short courses of each family. How many of hundreds arrive is measured by benchmarks/machines.py."""
MORE_SEEDS = {"gate": (0, 1, 2, 3, 4)}
"""The manoeuvre of 2016 is not at home in every gate: it may fail once."""
Arrivals = tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float64]]
COURSE = Path(tral_env.__file__).parent / "course" / "examples" / "default.json"


@pytest.mark.parametrize(("name", "scenario"), FAMILY_OF.items())
def test_it_drives_its_family(name: str, scenario: str) -> None:
    seeds = MORE_SEEDS.get(name, SEEDS)
    runner = BatchRunner([scenario], rows=len(seeds))
    drives = runner.drive([load_machine(name)], [EpisodeRequest(0, scenario, seed) for seed in seeds])
    runner.close()
    assert sum(not drive.success for drive in drives) <= (name in MORE_SEEDS)


def test_office_drives_every_family() -> None:
    families = [*dict.fromkeys(FAMILY_OF.values()), "office"]
    runner = BatchRunner(families, rows=len(families))
    drives = runner.drive([load_machine("office")], [EpisodeRequest(0, family, SEEDS[-1]) for family in families])
    runner.close()
    assert [(drive.scenario, drive.seed) for drive in drives if not drive.success] == []


def drive_to_the_end(world: World, machine: str) -> Arrivals:
    """(n,) whether each row arrived, whether it hit something, and where it was in the end."""
    rows = world.n
    world.reset(world.request(np.arange(rows)), [np.random.default_rng(seed) for seed in range(rows)])
    policy, driving = load_policy(machine), np.ones(rows, bool)
    success, collision = np.zeros(rows, bool), np.zeros(rows, bool)
    policy.reset(rows)
    observation = world.observation()
    while driving.any():
        step = world.step(policy.act(observation), np.flatnonzero(driving))
        observation = step.observation
        success |= driving & step.info["success"]
        collision |= driving & step.info["collision"]
        driving &= ~(step.terminated | step.truncated)
    return success, collision, world.sim.pose[:, 0].copy()


def test_the_known_route_is_driven_to_its_end() -> None:
    success, _, _ = drive_to_the_end(World(2, CorridorConfig(course=COURSE)), "known_route")
    assert success.all()


@pytest.mark.parametrize("machine", ["gate", "gate_scurve", "office"])
@pytest.mark.parametrize(("width", "passed"), [(0.4, False), (0.55, True)])
def test_a_gate_that_is_too_narrow_is_refused_with_a_stop(machine: str, width: float, passed: bool) -> None:
    gate = {"id": 0, "at": 4.0, "width": width}
    course = Course.model_validate({"name": "narrow", "segments": [{"length": 6.0, "width": 2.0, "gates": [gate]}]})
    success, collision, x = drive_to_the_end(World(2, CorridorConfig(course=course)), machine)
    assert not collision.any()
    assert (success == passed).all()
    assert ((x > 4.0) == passed).all()


def test_corner_is_a_machine_that_others_hold() -> None:
    holders = {
        name
        for name in machine_names()
        for state in load_machine(name).states
        if isinstance(state, FSMStateSpec) and state.machine == "corner"
    }
    assert holders == {"corners", "loop"}
