"""The line the car should take, and whether it can."""

from __future__ import annotations

import numpy as np
import pytest
from by_hand import complaint, plan_of
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_env.config import CarConfig
from tral_env.course.drivable import CLEARANCE, clearance, curvatures, headings
from tral_env.course.generate import SCENARIOS, generate_plan
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, example_names, example_path
from tral_env.course.plan import Plan
from tral_env.course.route import CORNER_RADIUS

CAR = CarConfig()
FULL_LOCK = np.tan(CAR.full_lock) / CAR.wheelbase


def swept_clearance(plan: Plan) -> float:
    """Least distance of a car, drawn as 200 points, to any box: slow and plain."""
    edge = np.linspace(-0.5, 0.5, 50)
    border = np.concatenate([np.column_stack([edge, np.full(50, s)]) for s in (-0.5, 0.5)])
    border = np.concatenate([border, border[:, ::-1]]) * [CAR.length, CAR.width] + [CAR.middle_x, 0.0]
    least = np.inf
    for (x, y), yaw in zip(plan.route, headings(plan.route), strict=True):
        c, s = np.cos(yaw), np.sin(yaw)
        body = border @ np.array([[c, s], [-s, c]]) + [x, y]
        for p, half, turn in zip(plan.box_position[:, :2], plan.box_size[:, :2], plan.box_yaw, strict=True):
            if np.linalg.norm(p - [x, y]) < np.linalg.norm(half) + 1:
                c, s = np.cos(turn), np.sin(turn)
                gap = np.maximum(np.abs((body - p) @ np.array([[c, -s], [s, c]])) - half, 0)
                least = min(least, np.linalg.norm(gap, axis=1).min())
    return float(least)


@pytest.mark.parametrize("family", list(SCENARIOS))
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_generated_routes_can_be_driven(family: str, seed: int):
    _, plan = generate_plan(family, np.random.default_rng(seed))
    steps = np.diff(plan.route_s)
    assert steps.max() <= 0.1
    assert steps.min() > 0
    assert np.abs(curvatures(plan.route)).max() <= FULL_LOCK
    assert clearance(plan) >= CLEARANCE


@pytest.mark.parametrize("family", ["corners", "gates", "obstacles"])
def test_the_clearance_is_what_a_finely_drawn_car_has(family: str):
    _, plan = generate_plan(family, np.random.default_rng(5))
    assert clearance(plan) == pytest.approx(min(0.2, swept_clearance(plan)), abs=0.01)


@pytest.mark.parametrize("family", [name for name in SCENARIOS if name != "loop"])
def test_a_route_begins_at_the_start_pose(family: str):
    _, plan = generate_plan(family, np.random.default_rng(2))
    np.testing.assert_allclose(plan.route[0], plan.start[:2], atol=1e-9)
    assert headings(plan.route)[0] == pytest.approx(plan.start[2], abs=0.05)


def test_a_route_ends_at_the_goal_line_before_the_end_wall():
    plan = plan_of({"length": 10}, goal=1.5)
    np.testing.assert_allclose(plan.route[-1], [8.5, 0])
    assert plan.length == pytest.approx(7.5)


def test_a_corner_is_an_arc_that_the_car_can_steer():
    plan = plan_of({"length": 6, "then": "left"}, {"length": 6})
    assert plan.length == pytest.approx(5 + 5 - 2 * CORNER_RADIUS + CORNER_RADIUS * np.pi / 2, abs=0.01)
    assert curvatures(plan.route).max() == pytest.approx(1 / CORNER_RADIUS, rel=0.01)


def test_a_closed_route_is_one_lap_that_ends_where_it_begins():
    ring = [{"length": length, "then": "left"} for length in (8, 6, 8, 6)]
    plan = plan_of(*ring, closed=True, laps=3, start={"at": 3, "offset": 0.2})
    np.testing.assert_allclose(plan.route[-1], plan.route[0])
    assert np.linalg.norm(plan.route[0] - [3, 0]) <= 0.05
    assert plan.laps == 3
    assert plan.length == pytest.approx(28 - 8 * CORNER_RADIUS + 2 * np.pi * CORNER_RADIUS, abs=0.02)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32), family=st.sampled_from(["gates", "office"]))
def test_a_route_passes_each_gates_middle_straight_along_its_axis(seed: int, family: str):
    _, plan = generate_plan(family, np.random.default_rng(seed))
    for x, y, yaw in plan.gate_pose:
        offset = plan.route - [x, y]
        along = offset @ [np.cos(yaw), np.sin(yaw)]
        near = (np.abs(along) < 0.45) & (np.linalg.norm(offset, axis=1) < 1)
        assert near.sum() >= 8
        np.testing.assert_allclose(offset[near] @ [-np.sin(yaw), np.cos(yaw)], 0, atol=1e-9)
        assert (np.diff(along[near]) > 0).all()


def test_the_route_goes_past_a_box_on_the_wider_side():
    plan = plan_of({"length": 12, "width": 2, "obstacles": [{"at": 6, "offset": 0.3, "length": 0.4, "width": 0.4}]})
    beside = np.abs(plan.route[:, 0] - 6) < 0.2
    np.testing.assert_allclose(plan.route[beside, 1], 0.1 - 0.5)


def test_where_the_way_is_narrow_the_route_takes_its_middle():
    plan = plan_of({"length": 12, "width": 1.6, "cupboards": [{"side": "left", "at": 6, "depth": 0.9}]})
    beside = np.abs(plan.route[:, 0] - 6) < 1
    np.testing.assert_allclose(plan.route[beside, 1], (-0.8 + -0.1) / 2)


def test_what_stands_side_by_side_is_passed_between():
    boxes = [{"at": 6, "offset": offset} for offset in (-0.5, 0.6)]
    plan = plan_of({"length": 12, "width": 2, "obstacles": boxes})
    beside = np.abs(plan.route[:, 0] - 6) < 0.2
    np.testing.assert_allclose(plan.route[beside, 1], 0.05)


def test_a_blocked_corridor_is_refused():
    cupboard = {"side": "left", "at": 6, "depth": 1.2}
    assert "no way of 0.5 m past what stands from 4.60 to 7.12 m" in complaint(
        {"length": 12, "width": 1.6, "cupboards": [cupboard]}
    )


def test_things_too_near_to_each_other_are_refused_with_their_place():
    gates = [{"id": k, "at": at} for k, at in enumerate((5, 5.5))]
    assert "/segments/0: things stand too near to each other" in complaint({"length": 12, "gates": gates})


def test_a_shift_that_the_car_cannot_steer_is_refused_with_its_place():
    gates = [{"id": k, "at": at, "offset": y, "width": 0.6} for k, (at, y) in enumerate(((5, 0.5), (6.6, -0.5)))]
    message = complaint({"length": 12, "width": 2.6, "gates": gates})
    assert "the route bends with a radius of" in message
    assert "Allowed: 0.64 m or more" in message


def test_a_corner_too_narrow_for_the_car_is_refused():
    message = complaint({"length": 6, "width": 0.6, "then": "left"}, {"length": 6, "width": 0.6})
    assert "on the route the car comes within 0.0" in message


def test_a_segment_too_short_for_its_corners_is_refused():
    ends = {"length": 6, "width": 1, "then": "left"}
    message = complaint(ends, {"length": 1.5, "width": 1, "then": "right"}, {"length": 6, "width": 1})
    assert "/segments/1/length: got 1.5. Allowed: above 1.8" in message


@pytest.mark.parametrize("name", example_names())
def test_examples_can_be_driven(name: str):
    assert clearance(build_plan(Course.load(example_path(name)))) >= 0.1
