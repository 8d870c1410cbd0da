"""Only the boxes around a car stand in its physics, and no reading shows it."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tral_env.course.generate import SCENARIOS, generate_plan
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Door, Segment
from tral_env.course.scene import Placement
from tral_env.options import CorridorConfig
from tral_env.simulation import culling
from tral_env.simulation.culling import REACH_M, LocalGeoms, max_boxes_in_reach
from tral_env.world import World


def line_of_boxes(count: int) -> Placement:
    """Boxes of 0.2 x 0.2 m, one a metre along x, the first at 0."""
    pos = np.zeros((count, 3))
    pos[:, 0], pos[:, 2] = np.arange(count), 0.25
    return Placement(pos, np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), np.full((count, 3), 0.1))


def surrounded(count: int, x: float) -> tuple[LocalGeoms, np.ndarray]:
    all_around = LocalGeoms(1, count)
    all_around.place(0, line_of_boxes(count))
    pos, _, _ = all_around.nearest(np.array([0]), np.array([[x, 0.0]]))
    return all_around, pos[0, :, 0]


def test_the_nearest_boxes_stand_in_the_order_of_the_course():
    _, x = surrounded(100, 30.0)
    assert len(x) == culling.LOCAL_BOXES == 48
    assert_array_equal(x, np.arange(6, 54))


def test_it_looks_again_before_a_box_left_out_comes_within_reach():
    around, _ = surrounded(100, 30.0)
    free = 23.9 - REACH_M  # the box at 54 m begins at 53.9 m
    assert len(around.due(np.array([[30.0 + free - 0.01, 0.0]]))) == 0
    assert_array_equal(around.due(np.array([[30.0 + free + 0.01, 0.0]])), [0])


def test_a_course_of_few_boxes_is_there_as_a_whole():
    around, x = surrounded(5, 0.0)
    assert_array_equal(x, np.arange(5))
    assert len(around.due(np.array([[1e6, 0.0]]))) == 0


def test_a_box_is_as_near_as_its_nearest_side():
    around = LocalGeoms(1, 60)
    placed = line_of_boxes(60)
    placed.geom_pos[:, 0] = 100.0 + np.arange(60)
    placed.geom_pos[59, :2] = 0.0, 20.0
    placed.geom_size[59, :2] = 0.1, 15.0
    placed.geom_quat[59] = np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4)  # long along x: its side is 19.9 m away
    around.place(0, placed)
    _, _, half = around.nearest(np.array([0]), np.zeros((1, 2)))
    assert half[0, -1, 1] == 15.0


def dense() -> Course:
    """A door each 1.15 m on both sides: up to 90 boxes near the car."""
    doors = tuple(Door(side=side, at=1.6 + 1.15 * i) for i in range(11) for side in ("left", "right"))
    return Course(name="dense", segments=(Segment(length=16.0, width=2.0, doors=doors),))


def ranges(near: str) -> np.ndarray:
    """Readings of a drive through a dense course, that was named at the start or at the reset."""
    fixed = CorridorConfig(scenario="straight", randomization="none", course=dense() if near == "start" else None)
    world = World(1, fixed)
    request = world.request(np.array([0]), {"course": dense()} if near == "reset" else None)
    world.reset(request, [np.random.default_rng(0)])
    return np.stack([world.observation()] + [world.step(np.array([[0.0, 0.5]])).observation for _ in range(500)])


@pytest.mark.parametrize("near", ["start", "reset"])
def test_a_dense_course_is_seen_as_a_whole(near: str, monkeypatch: pytest.MonkeyPatch):
    assert max_boxes_in_reach(build_plan(dense())) > culling.LOCAL_BOXES
    seen = ranges(near)
    monkeypatch.setattr(culling, "LOCAL_BOXES", 1000)
    assert_array_equal(seen, ranges("start"))


def test_courses_of_the_families_need_no_more_local_boxes():
    for scenario in SCENARIOS:
        draws = [(seed, hard) for seed in range(3) for hard in (False, True)]
        plans = [generate_plan(scenario, np.random.default_rng(seed), hard=hard)[1] for seed, hard in draws]
        assert max(max_boxes_in_reach(plan) for plan in plans) <= culling.LOCAL_BOXES
