"""Seeded courses: families with the numbers they are promised to have."""

from __future__ import annotations

import hashlib
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_env.course.generate import FAMILIES, Draft, Family, draw, generate, generate_plan
from tral_env.course.geometry import build_plan
from tral_env.course.layout import Course, Segment
from tral_env.errors import ConfigError, CourseError
from tral_env.interface import STRONG_GATES

SEEDS = range(40)


def courses(family: str, hard: bool = False) -> list[Course]:
    return [generate(family, np.random.default_rng(seed), hard=hard) for seed in SEEDS]


def segments(family: str) -> list[Segment]:
    return [segment for course in courses(family) for segment in course.segments]


def passage(width: float, offset: float, half: float) -> float:
    """The wider way past something."""
    return width / 2 + abs(offset) - half


def test_an_unknown_family_names_the_nearest():
    with pytest.raises(ConfigError, match="unknown scenario 'corner': did you mean 'corners'"):
        generate("corner", np.random.default_rng(0))


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_seed_gives_the_same_course_again_and_a_plan_within_limits(family: str, seed: int):
    course, plan = generate_plan(family, np.random.default_rng(seed))
    assert generate(family, np.random.default_rng(seed)) == course
    assert len(plan.box_kind) <= FAMILIES[family].max_boxes
    assert len(plan.marker_id) <= FAMILIES[family].max_markers


DIGESTS = {
    "straight": "c438cd1f1222a121",
    "doors": "e860874a4151ee02",
    "corners": "88d025ea7d365d1c",
    "loop": "75c2b5d63d1bc72e",
    "lane_change": "5163dbf1160b44d0",
    "obstacles": "8ae75dc00d51d59a",
    "gates": "aa8e7c6a625b38d5",
    "crossing": "5917690f1ca5b4d1",
    "office": "4d47f71a20c090bc",
}
"""Family -> digest of its first five courses. A new family adds a line and changes none."""
HARD_DIGESTS = DIGESTS | {"gates": "ff8cc15ef6de40da"}


def digest(family: str, hard: bool) -> str:
    told = hashlib.sha256()
    for seed in range(5):
        told.update(generate(family, np.random.default_rng(seed), hard=hard).to_json().encode())
    return told.hexdigest()[:16]


@pytest.mark.parametrize("family", FAMILIES)
def test_the_courses_of_a_seed_are_those_that_results_were_measured_on(family: str):
    assert family in DIGESTS, f"add the line '{family}': '{digest(family, False)}' to DIGESTS"
    assert digest(family, False) == DIGESTS[family]
    assert digest(family, True) == HARD_DIGESTS[family]


def test_a_family_that_draws_no_drivable_course_names_the_most_frequent_cause():
    def narrow(rng: np.random.Generator, hard: bool) -> Draft:
        gates = [{"id": 0, "at": round(5 + rng.random(), 3), "width": 1.9}]
        return {"segments": [{"length": 12, "width": 2, "gates": gates}]}

    family = Family(meaning="a gate wider than its corridor", sketch=narrow, max_boxes=8, max_markers=2)
    with pytest.raises(
        CourseError, match=r"no drivable course of 'wide' in 200 drafts.*cause, in 200 drafts: course"
    ) as told:
        draw("wide", family, np.random.default_rng(0))
    assert "/segments/0/gates/0" in str(told.value)


def test_segments_that_cannot_be_joined_are_told_instead_of_tried_for_ever(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("tral_env.course.drafts.overlap_problems", lambda course, frames: ["too near"])
    monkeypatch.setattr("tral_env.course.drafts.JOIN_ATTEMPTS", 3)
    with pytest.raises(CourseError, match=r"no drivable course of 'office' .* could not be joined in 3 ways"):
        generate("office", np.random.default_rng(0))


def test_a_family_whose_limits_are_too_small_names_them():
    def straight(rng: np.random.Generator, hard: bool) -> Draft:
        return {"segments": [{"length": 12, "width": 2, "obstacles": [{"at": 6, "offset": 0.6}]}]}

    family = Family(meaning="one box", sketch=straight, max_boxes=4, max_markers=0)
    with pytest.raises(CourseError, match="in 200 drafts: 5 boxes and 0 markers, where the family allows 4 and 0"):
        draw("box", family, np.random.default_rng(0))


@pytest.mark.parametrize("hard", [False, True])
@pytest.mark.parametrize("family", FAMILIES)
def test_its_gates_are_the_strong_ones_in_order(family: str, hard: bool):
    most = 0
    for seed in range(50):
        course = generate(family, np.random.default_rng(seed), hard=hard)
        ids = [gate.id for segment in course.segments for gate in segment.gates]
        assert ids == [*STRONG_GATES[: len(ids)]]
        most = max(most, len(ids))
    assert (most > 0) == (family in ("gates", "office"))


@pytest.mark.parametrize("family", FAMILIES)
def test_a_generated_course_survives_its_file(family: str):
    course, plan = generate_plan(family, np.random.default_rng(3))
    again = Course.parse(course.to_json())
    assert again == course
    np.testing.assert_array_equal(build_plan(again).box_position, plan.box_position)


@pytest.mark.parametrize("family", FAMILIES)
def test_corridors_are_1_6_to_2_6_m_wide(family: str):
    widths = [segment.width for segment in segments(family)]
    assert 1.6 <= min(widths) < 1.7
    assert 2.5 < max(widths) <= 2.6


@pytest.mark.parametrize("family", FAMILIES)
def test_the_car_starts_in_the_middle_third_within_five_degrees(family: str):
    for course in courses(family):
        assert abs(course.start.offset) <= course.segments[0].width / 6
        assert abs(course.start.heading_deg) <= 5


@pytest.mark.parametrize("family", ["straight", "doors", "lane_change", "obstacles"])
def test_straight_families_are_one_segment_of_12_to_20_m(family: str):
    for course in courses(family):
        assert len(course.segments) == 1
        assert 12 <= course.segments[0].length <= 20


def test_doors_are_on_both_sides_every_2_to_5_m():
    for segment in segments("doors"):
        for side in ("left", "right"):
            at = [door.at for door in segment.doors if door.side == side]
            assert len(at) >= 2
            assert all(2 <= gap <= 5.001 for gap in np.diff(at))


def test_doors_have_the_promised_sizes_and_one_in_ten_is_open():
    doors = [door for segment in segments("doors") for door in segment.doors]
    assert all(0.8 <= door.width <= 1.0 and 0.03 <= door.recess <= 0.1 and 0.02 <= door.frame <= 0.04 for door in doors)
    assert 0.05 < np.mean([door.open for door in doors]) < 0.15


def test_corners_join_3_to_5_segments_of_3_to_8_m_left_and_right():
    drawn = courses("corners")
    assert {len(course.segments) for course in drawn} == {3, 4, 5}
    assert {segment.then for segment in segments("corners")} == {"left", "right", "end"}
    assert all(3 <= segment.length <= 8 for segment in segments("corners"))


def test_a_loop_is_a_ring_of_6_to_12_m_driven_left_or_right_about():
    turns = set()
    for course in courses("loop"):
        turns.add(course.segments[0].then)
        assert (len(course.segments), course.closed, course.laps) == (4, True, 1)
        assert all(6 <= segment.length <= 12 for segment in course.segments)
    assert turns == {"left", "right"}


def test_cupboards_have_the_promised_sizes_and_leave_0_8_m():
    for segment in segments("lane_change"):
        assert segment.cupboards
        for cupboard in segment.cupboards:
            assert 0.3 <= cupboard.depth <= 0.6
            assert 1.5 <= cupboard.length <= 4
            assert segment.width - cupboard.depth >= 0.8
        ends = [(c.at - c.length / 2, c.at + c.length / 2) for c in segment.cupboards]
        assert all(end < begin for (_, end), (begin, _) in itertools.pairwise(ends))


def test_boxes_have_the_promised_sizes_are_3_m_apart_and_leave_0_7_m():
    counts = set()
    for segment in segments("obstacles"):
        counts.add(len(segment.obstacles))
        for box in segment.obstacles:
            c, s = np.cos(np.radians(box.yaw_deg)), abs(np.sin(np.radians(box.yaw_deg)))
            assert 0.2 <= box.length <= 0.4
            assert 0.2 <= box.width <= 0.4
            assert passage(segment.width, box.offset, (box.length * s + box.width * c) / 2) >= 0.7
        assert all(b.at - a.at >= 3 for a, b in itertools.pairwise(segment.obstacles))
    assert counts == {1, 2, 3, 4}


def test_gates_have_the_promised_sizes_and_distances():
    counts = set()
    for course in courses("gates"):
        gates = [(i, segment, gate) for i, segment in enumerate(course.segments) for gate in segment.gates]
        counts.add(len(gates))
        assert len(course.segments) <= 2
        assert gates[0][0] == 1 or gates[0][2].at - course.start.at >= 3.5
        for _, segment, gate in gates:
            assert 0.6 <= gate.width <= 1.2
            assert abs(gate.yaw_deg) <= 10
            assert 0.15 <= gate.marker_height <= 0.3
            assert segment.width / 2 - abs(gate.offset) - gate.width / 2 >= 0.25 - 1e-9
        for (i, _, a), (j, _, b) in itertools.pairwise(gates):
            assert i != j or b.at - a.at >= 4
    assert counts == {1, 2, 3}


def test_only_hard_gates_stand_right_behind_a_corner_or_where_a_wall_is_open():
    def nearest_to_corner(drawn: list[Course]) -> float:
        bent = [course.segments for course in drawn if len(course.segments) == 2 and course.segments[1].gates]
        return min(after.gates[0].at - before.width / 2 for before, after in bent)

    easy, hard = courses("gates"), courses("gates", hard=True)
    assert nearest_to_corner(easy) >= 1.9
    assert 0.8 <= nearest_to_corner(hard) <= 1.3
    assert not any(segment.branches for course in easy for segment in course.segments)
    assert any(segment.branches for course in hard for segment in course.segments)


def test_crossings_are_1_to_3_t_or_x_with_a_sign_for_each():
    counts, ways, turns = set(), set(), set()
    for seed in SEEDS:
        course, plan = generate_plan("crossing", np.random.default_rng(seed))
        crossings = [segment for segment in course.segments if segment.branches]
        counts.add(len(crossings))
        ways |= {len(segment.branches) for segment in crossings}
        turns |= {segment.then for segment in crossings}
        signs = [{"left": 40, "right": 41, "straight": 42}[segment.then] for segment in crossings]
        assert plan.marker_id.tolist() == signs
    assert (counts, ways, turns) == ({1, 2, 3}, {1, 2}, {"left", "right", "straight"})


def test_an_office_is_25_to_60_m_of_everything():
    drawn = courses("office")
    lengths = [sum(segment.length for segment in course.segments) for course in drawn]
    assert 25 <= min(lengths) < 30
    assert 50 < max(lengths) <= 60
    every = [segment for course in drawn for segment in course.segments]
    for furniture in ("doors", "cupboards", "obstacles", "gates", "branches"):
        assert any(getattr(segment, furniture) for segment in every), furniture
    assert {segment.then for segment in every} == {"left", "right", "straight", "end"}


@pytest.mark.parametrize("family", FAMILIES)
def test_an_endless_supply_of_courses_fits_its_limits(family: str):
    rng = np.random.default_rng(0)
    assert max(len(generate_plan(family, rng)[1].box_kind) for _ in range(200)) <= FAMILIES[family].max_boxes
