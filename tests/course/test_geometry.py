"""From a course to boxes: closed walls, doors, gates, signs."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from by_hand import complaint, plan_of
from hypothesis import given, settings
from hypothesis import strategies as st
from probe import CELL, flat, flooded, hidden, leaks, overlaps

from tral_env.course.frames import place_segments
from tral_env.course.furniture import WALL_THICKNESS
from tral_env.course.generate import SCENARIOS, generate_plan
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, example_names, example_path
from tral_env.course.plan import BOX_KINDS, begun_at
from tral_env.geometry import MARKER_BOARD_WIDTH_M

families = pytest.mark.parametrize("family", list(SCENARIOS))


@families
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_walls_and_doors_enclose_the_floor(family: str, seed: int):
    _, plan = generate_plan(family, np.random.default_rng(seed))
    assert not leaks(plan)
    wet, corner = flooded(plan)
    cells = ((plan.route - corner) / CELL).astype(int)
    assert wet[cells[:, 1], cells[:, 0]].all()


@families
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_no_two_boxes_overlap(family: str, seed: int):
    assert overlaps(generate_plan(family, np.random.default_rng(seed))[1]) < 1e-4  # m


@families
def test_every_box_stands_on_the_floor_and_is_taller_than_the_sonars_are_high(family: str):
    _, plan = generate_plan(family, np.random.default_rng(0))
    np.testing.assert_allclose(plan.box_position[:, 2], plan.box_size[:, 2])
    assert (2 * plan.box_size[:, 2] > 0.2).all()


@pytest.mark.parametrize("name", example_names())
def test_examples_are_closed_and_without_overlaps(name: str):
    plan = build_plan(Course.load(example_path(name)))
    assert not leaks(plan)
    assert overlaps(plan) < 1e-5


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7])
def test_a_course_from_a_place_on_is_the_rest_of_it(share: float):
    plan = generate_plan("gates", np.random.default_rng(4))[1]
    place = share * plan.length
    rest = begun_at(plan, place)
    assert rest.length == pytest.approx(plan.length - place)
    assert rest.route[-1].tolist() == plan.route[-1].tolist()
    assert rest.start[:2].tolist() == rest.route[0].tolist()
    along = rest.route[1] - rest.route[0]
    assert rest.start[2] == pytest.approx(np.arctan2(along[1], along[0]))
    assert rest.gate_s == pytest.approx(plan.gate_s[plan.gate_s > place] - place)
    assert len(rest.gate_id) == len(rest.gate_width) == len(rest.gate_pose)
    assert rest.box_position is plan.box_position


def test_a_straight_corridor_is_four_walls_of_the_promised_width():
    walls = flat(plan_of({"length": 10, "width": 2}), "wall")
    assert len(walls) == 4
    t = WALL_THICKNESS
    np.testing.assert_allclose([walls[:, :2].min(0), walls[:, 2:].max(0)], [(-t, -1 - t), (10 + t, 1 + t)])


def test_a_corner_turns_about_the_node():
    plan = plan_of({"length": 5, "width": 2, "then": "left"}, {"length": 4, "width": 1.6})
    wet, _ = flooded(plan)
    # The two corridors, the part of the corner square outside both halves included.
    assert wet.sum() * CELL**2 == pytest.approx(5.8 * 2 + 3 * 1.6, abs=0.1)


def test_a_closed_door_stands_back_by_its_recess():
    door = {"side": "left", "at": 4, "width": 0.9, "recess": 0.07, "frame": 0.03}
    plan = plan_of({"length": 10, "width": 2, "doors": [door]})
    np.testing.assert_allclose(flat(plan, "door"), [[3.55, 1.07, 4.45, 1.15]])
    np.testing.assert_allclose(flat(plan, "frame"), [[3.49, 0.97, 3.55, 1.0], [4.45, 0.97, 4.51, 1.0]])


def test_an_open_door_shows_a_room_of_1_5_m():
    closed = plan_of({"length": 10, "doors": [{"side": "right", "at": 5, "recess": 0, "width": 1}]})
    plan = plan_of({"length": 10, "doors": [{"side": "right", "at": 5, "open": True, "width": 1}]})
    room = flooded(plan)[0].sum() - flooded(closed)[0].sum()
    leaf = 0.04 * 0.5
    assert room * CELL**2 == pytest.approx(1.5**2 + WALL_THICKNESS * 1 - leaf, abs=0.06)
    assert flat(plan, "wall")[:, 1].min() == pytest.approx(-1 - 2 * WALL_THICKNESS - 1.5)


def test_a_cupboard_stands_at_its_wall():
    plan = plan_of({"length": 12, "width": 2, "cupboards": [{"side": "right", "at": 6, "length": 2, "depth": 0.5}]})
    np.testing.assert_allclose(flat(plan, "obstacle"), [[5, -1, 7, -0.5]])


def test_a_gate_is_as_wide_inside_as_it_says():
    gate = {"id": 3, "at": 6, "offset": 0.1, "width": 0.8}
    plan = plan_of({"length": 12, "width": 2, "gates": [gate]})
    np.testing.assert_allclose(plan.gate_pose, [[6, 0.1, 0]])
    left, right = flat(plan, "post")
    assert left[1] - right[3] == pytest.approx(plan.gate_width[0]) == 0.8
    assert plan.gate_id.tolist() == [3]


def test_gate_markers_face_the_car_left_then_right_flush_with_the_boards_edges():
    plan = plan_of({"length": 12, "width": 2, "gates": [{"id": 3, "at": 6, "width": 0.8, "marker_height": 0.25}]})
    assert plan.marker_id.tolist() == [6, 7]
    np.testing.assert_allclose(plan.marker_position[:, 1:], [(0.52, 0.25), (-0.52, 0.25)])
    assert (plan.marker_position[:, 0] < flat(plan, "post")[:, 0]).all()
    np.testing.assert_allclose(np.cos(plan.marker_yaw), -1)
    assert pytest.approx(0.8 / 2 + MARKER_BOARD_WIDTH_M / 2) == 0.52


def test_a_turned_gate_turns_about_its_middle():
    straight, turned = (
        plan_of({"length": 12, "width": 2.4, "gates": [{"id": 0, "at": 6, "yaw_deg": yaw}]}) for yaw in (0, 10)
    )
    posts = turned.box_kind == BOX_KINDS.index("post")
    middle = turned.box_position[posts, :2].mean(axis=0)
    np.testing.assert_allclose(middle, [6, 0], atol=1e-12)
    np.testing.assert_allclose(np.degrees(turned.box_yaw[posts]), 10)
    assert straight.gate_width[0] == turned.gate_width[0]


@pytest.mark.parametrize(("then", "marker"), [("left", 40), ("right", 41), ("straight", 42)])
def test_the_sign_of_a_crossing_tells_the_turn(then: str, marker: int):
    others = [{"to": way} for way in ("left", "right", "straight") if way != then]
    plan = plan_of({"length": 6, "then": then, "branches": others}, {"length": 5})
    assert plan.marker_id.tolist() == [marker]


def test_a_crossing_can_go_without_a_sign():
    plan = plan_of({"length": 6, "then": "left", "branches": [{"to": "right"}], "sign": False}, {"length": 5})
    assert len(plan.marker_id) == 0


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_sign_is_in_view_2_5_m_before_its_crossing(seed: int):
    course, plan = generate_plan("crossing", np.random.default_rng(seed))
    crossings = [frame for frame in place_segments(course) if frame.segment.branches]
    assert len(crossings) == len(plan.marker_id)
    for frame, face, yaw in zip(crossings, plan.marker_position[:, :2], plan.marker_yaw, strict=True):
        eye = np.array(frame.point(frame.clear_to - 2.5, 0.0))
        for end in (-0.5, 0.5):
            corner = face + end * plan.marker_size * np.array([-np.sin(yaw), np.cos(yaw)])
            bearing = np.arctan2(*(corner - eye)[::-1]) - frame.yaw
            assert np.cos(bearing) > np.cos(np.radians(30))
            assert not hidden(plan, eye, corner)


def test_tape_lies_along_or_across():
    tapes = [{"at": 4, "length": 2, "offset": 0.3}, {"at": 6, "length": 1, "across": True}]
    plan = plan_of({"length": 10, "tapes": tapes})
    np.testing.assert_allclose(plan.tape, [[3, 0.3, 5, 0.3], [6, -0.5, 6, 0.5]])


def test_straights_are_a_metre_from_doors_and_ends():
    door = {"side": "left", "at": 5, "width": 1}
    plan = plan_of({"length": 10, "width": 2, "doors": [door]})
    np.testing.assert_allclose(plan.straights, [[1, 0, 0, 2.5, 2], [6.5, 0, 0, 2.5, 2]])


def test_corridors_that_cross_are_refused_with_both_names():
    ring = [{"length": length, "then": "left"} for length in (8, 5, 5, 8)]
    assert "/segments/0: too near to /segments/3" in complaint(*ring, {"length": 5})


def test_a_room_in_another_corridor_is_refused():
    first = {"length": 6, "then": "left", "doors": [{"side": "left", "at": 4.2, "open": True}]}
    assert "/segments/0/doors/0: too near to /segments/1" in complaint(first, {"length": 5})


def rooms(*doors: tuple[str, float]) -> dict[str, object]:
    """A corridor with open doors, each given by its side and place."""
    return {"length": 10, "doors": [{"side": side, "at": at, "open": True} for side, at in doors]}


def test_rooms_of_one_side_that_overlap_are_refused_with_both_names():
    told = complaint(rooms(("left", 4), ("right", 4.6), ("left", 5.2)))
    assert "/segments/0/doors/0: too near to /segments/0/doors/2. Allowed: 0.3 m for two walls" in told


def test_rooms_with_two_walls_between_them_and_rooms_on_both_sides_are_built():
    assert len(plan_of(rooms(("left", 4), ("right", 4.6), ("left", 5.8))).box_kind) > 0


def test_a_closed_course_must_close():
    ring = [{"length": length, "then": "left"} for length in (8, 5, 7, 5)]
    assert "/closed: the last segment ends at (1.000, 0.000) heading 0 deg" in complaint(*ring, closed=True)


@pytest.mark.parametrize(
    ("members", "place"),
    [
        ({"doors": [{"side": "left", "at": 0.2}]}, "/segments/0/doors/0/at: got 0.2. Allowed: 0.51 to 9.49"),
        ({"cupboards": [{"side": "left", "at": 9.5}]}, "/segments/0/cupboards/0/at: got 9.5. Allowed: 1 to 9"),
        ({"gates": [{"id": 0, "at": 5, "offset": 0.7}]}, "stick in the wall. Allowed: offset within 0.36"),
    ],
)
def test_what_does_not_fit_between_the_walls_is_refused(members: dict[str, object], place: str):
    assert place in complaint({"length": 10, "width": 2, **members})


def test_all_problems_are_told_at_once():
    doors = [{"side": "left", "at": at} for at in (0.1, 5, 9.9)]
    assert complaint({"length": 10, "doors": doors}).count("/doors/") == 2


def test_doors_must_leave_room_for_their_frames():
    doors = [{"side": "left", "at": at, "width": 1} for at in (3, 4.1)]
    assert "/segments/0/doors/1/at: got 4.1, beside a door at 3. Allowed: 4.12 or more" in complaint(
        {"length": 10, "doors": doors}
    )
    assert plan_of({"length": 10, "doors": [doors[0], {**doors[1], "side": "right"}]}).length == 8


@pytest.mark.parametrize(
    ("members", "pair"),
    [
        (
            {"cupboards": [{"side": "left", "at": 5}], "doors": [{"side": "left", "at": 4.2}]},
            ("doors/0", "cupboards/0"),
        ),
        ({"obstacles": [{"at": 5, "offset": 0.95}]}, ("obstacles/0", "a wall")),
        (
            {"doors": [{"side": "left", "at": 5, "frame": 0.1}], "gates": [{"id": 0, "at": 4.53, "width": 1.5}]},
            ("doors/0", "gates/0"),
        ),
    ],
)
def test_things_that_overlap_are_named(members: dict[str, object], pair: tuple[str, str]):
    message = complaint({"length": 10, "width": 2, **members})
    assert "overlaps" in message
    assert all(name in message for name in pair)


@families
def test_posts_of_a_pair_never_block_the_car(family: str):
    _, plan = generate_plan(family, np.random.default_rng(7))
    assert (plan.gate_width >= 0.6).all()
    for a, b in itertools.pairwise(plan.gate_id.tolist()):
        assert b == a + 1


@pytest.mark.parametrize(("start", "order"), [(1.5, [0, 1]), (5.0, [1, 0]), (8.5, [0, 1])])
def test_the_gates_of_a_ring_come_in_the_order_in_which_a_lap_meets_them(start: float, order: list[int]):
    side = {"length": 10, "width": 2, "then": "left"}
    first = {**side, "gates": [{"id": 0, "at": 3.0}, {"id": 1, "at": 7.0}]}
    plan = plan_of(first, side, side, side, closed=True, start={"at": start})
    assert plan.gate_id.tolist() == order
    assert (np.diff(plan.gate_s) > 0).all()


def test_a_ring_whose_start_touches_a_wall_is_refused():
    side = {"length": 10, "width": 2, "then": "left"}
    said = complaint(side, side, side, side, closed=True, start={"at": 5, "offset": 0.85, "heading_deg": 30})
    assert "/start: the car stands within 0.000 m of a box" in said
