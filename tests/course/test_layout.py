"""Course files: what they may hold, and what is said about those that are wrong."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_env.course import layout
from tral_env.course.layout import Course, Segment, course_schema, example_names, example_path
from tral_env.errors import CourseError

SCHEMA_FILE = Path(layout.__file__).parent / "course.schema.json"
PLAIN = {"name": "plain", "segments": [{"length": 10}]}


def course(**members: object) -> Course:
    return Course.model_validate({**PLAIN, **members})


def problems(text: str) -> list[str]:
    with pytest.raises(CourseError) as caught:
        Course.parse(text, source="file.json")
    return str(caught.value).split("\n  ")


def test_a_name_and_one_segment_are_enough():
    plain = Course.parse(json.dumps(PLAIN))
    assert (plain.segments[0].width, plain.start.at, plain.goal, plain.laps) == (2.0, 1.0, 1.0, 1)


def test_the_schema_file_says_what_the_model_says():
    assert json.loads(SCHEMA_FILE.read_text()) == course_schema()


@pytest.mark.parametrize("name", example_names())
def test_examples_satisfy_the_schema(name: str):
    problems = jsonschema.Draft202012Validator(course_schema()).iter_errors(json.loads(example_path(name).read_text()))
    assert [problem.message for problem in problems] == []


@pytest.mark.parametrize("name", example_names())
def test_an_example_is_named_like_its_file_and_survives_saving(name: str, tmp_path: Path):
    loaded = Course.load(example_path(name))
    loaded.save(tmp_path / "copy.json")
    assert loaded.name == name
    assert Course.load(tmp_path / "copy.json") == loaded


def test_an_unknown_example_names_those_there_are():
    with pytest.raises(CourseError, match="no course 'defualt': did you mean 'default'"):
        example_path("defualt")


def test_a_key_that_stands_twice_is_told_with_its_place():
    twice = '{"name": "a", "segments": [{"length": 9, "gates": [{"id": 1, "at": 3}], "gates": []}], "name": "b"}'
    assert problems(twice) == [
        "file.json: 2 problems",
        "/name: is there more than once. Allowed: each key once",
        "/segments/0/gates: is there more than once. Allowed: each key once",
    ]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_file_may_begin_with_a_byte_order_mark(encoding: str, tmp_path: Path):
    file = tmp_path / "a.json"
    file.write_text(json.dumps({**PLAIN, "name": "Gänge"}, ensure_ascii=False), encoding=encoding)
    assert Course.load(file).name == "Gänge"
    assert Course.parse("\ufeff" + json.dumps(PLAIN)) == course()


def test_a_decimal_comma_is_guessed():
    (told,) = problems('{"name": "a", "segments": [{"length": 9,5}]}')
    assert told.endswith(": a decimal comma? JSON writes 0.8")


@pytest.mark.parametrize(
    ("wrong", "guess"),
    [
        ('// mine\n{"name": "a", "segments": [{"length": 9}]}', ": JSON has no comments; delete it"),
        ('{"name": "a", /* mine */ "segments": [{"length": 9}]}', ": JSON has no comments; delete it"),
        ('{"name": "a", "segments": [{"length": .5}]}', ": JSON writes 0.8, not .8 or +0.8"),
        ('{"name": "a", "segments": [{"length": +5}]}', ": JSON writes 0.8, not .8 or +0.8"),
        ("{'name': 'a'}", ': JSON writes "double quotes"'),
        ('{"name": "a" "segments": [{"length": 9}]}', ": is a comma missing before it?"),
    ],
)
def test_what_is_no_json_is_told_with_a_guess(wrong: str, guess: str):
    (told,) = problems(wrong)
    assert told.endswith(guess)


@pytest.mark.parametrize("wrong", ['{"name": "a", "segments": [{"length": 9},]}', '{"name": "a",}'])
def test_a_comma_too_many_is_told(wrong: str):
    (told,) = problems(wrong)
    assert "trailing comma" in told or told.endswith(": a comma too many before it?")  # Python 3.13 says it itself


@pytest.mark.parametrize(
    ("length", "told"),
    [
        ("3,5", '/segments/0/length: got "3,5". Allowed: a number, without quotes: 3.5'),
        ("35", '/segments/0/length: got "35". Allowed: a number, without quotes: 35'),
        ("long", '/segments/0/length: got "long". Allowed: a number'),
        (35000, "/segments/0/length: got 35000. Allowed: less than or equal to 200; lengths are in m"),
    ],
)
def test_a_number_in_quotes_or_in_another_unit_is_told(length: object, told: str):
    assert problems(json.dumps({"name": "a", "segments": [{"length": length}]}))[1:] == [told]


@given(st.integers(1, 100), st.integers(0, 19))
def test_a_whole_number_may_be_written_with_a_point(laps: int, gate: int):
    written = {"segments": [{"length": 9, "then": "left", "gates": [{"id": float(gate), "at": 3}]}]}
    read = Course.model_validate({"name": "a", "closed": True, "laps": float(laps), **written})
    assert (read.laps, read.segments[0].gates[0].id) == (laps, gate)


def test_members_with_their_default_value_are_not_written():
    assert json.loads(course().to_json()) == {"name": "plain", "segments": [{"length": 10.0}]}


def test_a_course_that_cannot_be_saved_leaves_the_old_file(tmp_path: Path):
    path = tmp_path / "mine.json"
    course().save(path)
    course(name="other").save(path)
    assert Course.load(path).name == "other"
    assert [*tmp_path.iterdir()] == [path]
    with pytest.raises(CourseError, match=r"nowhere/mine\.json: cannot be written: No such file or directory"):
        course().save(tmp_path / "nowhere" / "mine.json")
    with pytest.raises(CourseError, match="cannot be written: Is a directory"):
        course().save(tmp_path)


def test_all_problems_of_a_file_are_listed_with_place_got_and_allowed():
    text = """{"name": "x", "laps": 0, "segments": [{"length": 5, "widht": 2, "then": "lefd",
               "doors": [{"side": "lft", "at": -1}]}]}"""
    assert problems(text) == [
        "file.json: 5 problems",
        "/segments/0/then: got 'lefd': did you mean 'left'? Allowed: end, left, right, straight",
        "/segments/0/doors/0/side: got 'lft': did you mean 'left'? Allowed: left, right",
        "/segments/0/doors/0/at: got -1. Allowed: greater than or equal to 0",
        "/segments/0/widht: unknown member 'widht': did you mean 'width'? Allowed: length, width, then, branches, "
        "sign, doors, cupboards, obstacles, gates, tapes",
        "/laps: got 0. Allowed: greater than or equal to 1",
    ]


def test_a_missing_member_is_named_beside_those_there_may_be():
    assert problems('{"name": "x", "segments": [{"length": 5, "gates": [{"id": 1}]}]}')[1] == (
        "/segments/0/gates/0/at: missing. Members here: id, at, offset, width, yaw_deg, marker_height"
    )


def test_text_that_is_no_json_is_located():
    assert problems('{"name": }') == ["file.json:1:10: not JSON: Expecting value"]


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity"])
def test_numbers_must_be_finite(number: str):
    assert problems(f'{{"name": "x", "segments": [{{"length": {number}}}]}}')[1].startswith("/segments/0/length: got")


@pytest.mark.parametrize(
    ("members", "problem"),
    [
        ({"laps": 2}, '/laps: got 2 for an open course. Allowed: 1 (or "closed": true)'),
        ({"segments": []}, "/segments: got []. Allowed: a list of at least 1 item"),
        (
            {"segments": [{"length": 5}, {"length": 5}]},
            "/segments/0/then: got 'end' before the last segment. Allowed: left, right, straight",
        ),
        (
            {"segments": [{"length": 5, "then": "left"}]},
            "/segments/0/then: got 'left' in the last segment. Allowed: end (or \"closed\": true)",
        ),
        (
            {"segments": [{"length": 5, "branches": [{"to": "left"}]}]},
            "/segments/0/branches: got 1 at an end wall. Allowed: none",
        ),
        (
            {"segments": [{"length": 5, "then": "left", "branches": [{"to": "left"}]}, {"length": 5}]},
            "/segments/0/branches/0/to: got 'left', which is taken. Allowed: right, straight",
        ),
        (
            {"segments": [{"length": 5, "gates": [{"id": 3, "at": 3}, {"id": 3, "at": 9}]}]},
            "/segments/0/gates/1/at: got 9. Allowed: 0 to 5, the segment's length",
        ),
        (
            {"segments": [{"length": 9, "gates": [{"id": 3, "at": 3}, {"id": 3, "at": 8}]}]},
            "/segments/0/gates/1/id: got 3, which more than one gate has. Allowed: unique ids",
        ),
        ({"start": 3}, "/start: got 3. Allowed: an object"),
        ({"laps": "2"}, '/laps: got "2". Allowed: a whole number, without quotes: 2'),
        ({"name": ""}, '/name: got "". Allowed: at least 1 character'),
        ({"segments": [{"length": 5, "doors": 1}]}, "/segments/0/doors: got 1. Allowed: a list"),
        ({"start": {"offset": 0.9}}, "/start/offset: got 0.9. Allowed: within 0.85 of the middle line"),
    ],
)
def test_parts_that_do_not_fit_together_are_named(members: dict[str, object], problem: str):
    assert problem in problems(json.dumps({**PLAIN, **members}))


def test_courses_do_not_change():
    with pytest.raises(ValueError, match="frozen"):
        course().laps = 2  # type: ignore[misc]


@settings(max_examples=50, deadline=None)
@given(
    st.text(max_size=60) | st.recursive(st.none() | st.integers() | st.text(), st.lists, max_leaves=5).map(json.dumps)
)
def test_whatever_is_read_is_a_course_or_a_course_error(text: str):
    with pytest.raises(CourseError, match=r"file\.json"):
        Course.parse(text, source="file.json")


@pytest.mark.parametrize("text", ["[" * 100_000, "1" * 5000])
def test_json_that_cannot_be_held_is_a_course_error(text: str):
    with pytest.raises(CourseError, match=r"file\.json: not readable"):
        Course.parse(text, source="file.json")


def test_a_file_that_is_no_text_is_a_course_error(tmp_path: Path):
    (tmp_path / "a.json").write_bytes(b"\xff\xfe")
    with pytest.raises(CourseError, match=r"a\.json: not UTF-8 text: invalid start byte at byte 0"):
        Course.load(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("name", "why"), [("none.json", "No such file"), ("", "Is a directory"), ("a\0b", "null byte")]
)
def test_a_file_that_cannot_be_opened_is_a_course_error_with_its_path(tmp_path: Path, name: str, why: str):
    with pytest.raises(CourseError, match=f"{re.escape(str(tmp_path / name))}: cannot be read: .*{why}"):
        Course.load(tmp_path / name)


def told(segment: dict[str, Any], **members: Any) -> str:
    with pytest.raises(CourseError) as caught:
        Course.parse(json.dumps({"name": "a", "segments": [{"length": 12.0, **segment}], **members}))
    return str(caught.value)


@pytest.mark.parametrize(
    ("segment", "member"),
    [
        ({"gates": [{"id": 1, "at": 3.0, "yaw_deg": 45.0}]}, "30"),
        ({"obstacles": [{"at": 3.0, "yaw_deg": 100.0}]}, "90"),
    ],
)
def test_an_angle_is_not_called_a_length(segment: dict[str, Any], member: str) -> None:
    assert f"Allowed: less than or equal to {member}\n" in told(segment) + "\n"


@pytest.mark.parametrize(
    ("segment", "expected"),
    [
        ({"tapes": [{"at": 6.0, "length": 500.0}]}, "/segments/0/tapes/0/length: got 500. Allowed: 12 at most"),
        ({"tapes": [{"at": 6.0, "length": 3.0, "across": True}]}, "Allowed: 2 at most, the width of the segment"),
        (
            {"cupboards": [{"side": "left", "at": 6.0, "length": 300.0, "depth": 0.4}]},
            "/segments/0/cupboards/0/length: got 300. Allowed: 12 at most, the length of the segment",
        ),
    ],
)
def test_what_is_longer_than_its_segment_is_refused(segment: dict[str, Any], expected: str) -> None:
    assert expected in told(segment)


def test_a_course_file_may_name_its_schema_for_editors() -> None:
    text = json.dumps({"$schema": "course.schema.json", "name": "a", "segments": [{"length": 5.0}]})
    assert Course.parse(text).to_json() == Course(name="a", segments=(Segment(length=5.0),)).to_json()


def test_a_state_machine_is_no_course_and_the_one_line_says_what_takes_it():
    told = "file.json: a state machine, not a course: `tral drive --policy` takes it"
    assert problems('{"root": 0, "states": [], "transitions": []}') == [told]
