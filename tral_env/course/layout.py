"""What a course is, as plain data that a person can write: corridor segments and what stands in them.

A course is a chain of straight segments joined at right angles. A segment's length runs along its middle line from
node to node: from the end wall (or the middle of the corner) at its start to the middle of the corner, the middle of
the crossing or the end wall at its end. Inside a segment `at` counts from its start and `offset` from its middle
line, + is left, seen in driving direction.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from tral_env import atomic, json_text, validation_text
from tral_env.errors import CourseError, UnreadableCourseError, nearest, problem_report
from tral_env.interface import GATE_IDS

Side = Literal["left", "right"]
Direction = Literal["left", "right", "straight"]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Part(BaseModel):
    """Base of everything that a course file may hold: frozen, no unknown members, finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


class Door(Part):
    """A door in a wall of a segment."""

    side: Side
    """The wall that it is in."""
    at: NotNegative
    """Middle of the door, m along the segment."""
    width: Annotated[float, Field(ge=0.5, le=1.4)] = 0.9
    """Clear width, m."""
    recess: Annotated[float, Field(ge=0, le=0.12)] = 0.05
    """The closed leaf stands this far behind the wall's face, m."""
    frame: Annotated[float, Field(ge=0, le=0.1)] = 0.03
    """The frame stands out of the wall by this much, m."""
    open: bool = False
    """Whether it stands open and shows a room of 1.5 m x 1.5 m."""


class Cupboard(Part):
    """A cupboard along a wall of a segment."""

    side: Side
    """The wall that it stands at."""
    at: NotNegative
    """Its middle, m along the segment."""
    length: Positive = 2.0
    """Its extent along the wall, m."""
    depth: Positive = 0.4
    """Its extent into the corridor, m."""


class Obstacle(Part):
    """A box on the floor."""

    at: NotNegative
    """Its middle, m along the segment."""
    offset: float = 0.0
    """Its middle, m left of the middle line."""
    length: Positive = 0.3
    """Its extent along the segment (before turning), m."""
    width: Positive = 0.3
    """Its extent across the segment (before turning), m."""
    yaw_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    """It is turned counter-clockwise by this much, deg."""


class Gate(Part):
    """Two marker boards side by side. Gate k has the markers 2k (left) and 2k + 1 (right)."""

    id: Annotated[int, Field(ge=GATE_IDS[0], le=GATE_IDS[-1]), BeforeValidator(json_text.whole)]
    """Its number k, unique in the course."""
    at: NotNegative
    """Its middle, m along the segment."""
    offset: float = 0.0
    """Its middle, m left of the middle line."""
    width: Annotated[float, Field(ge=0.4, le=3)] = 0.8
    """Inner width between the boards, m."""
    yaw_deg: Annotated[float, Field(ge=-30, le=30)] = 0.0
    """Its axis is turned counter-clockwise against the segment by this much, deg."""
    marker_height: Annotated[float, Field(ge=0.12, le=0.38)] = 0.2
    """Height of the middle of its markers above the floor, m."""


class Tape(Part):
    """A strip of tape on the floor, for the line sensor."""

    at: NotNegative
    """Its middle, m along the segment."""
    length: Positive = 1.0
    """Its length, m."""
    offset: float = 0.0
    """Its middle, m left of the middle line."""
    across: bool = False
    """Whether it lies across the segment instead of along it."""


class Branch(Part):
    """A way at the end of a segment that the route does not take; it makes the end a T or X crossing."""

    to: Direction
    """Where it leads, seen in driving direction."""
    length: Annotated[float, Field(ge=0.5, le=20)] = 2.5
    """Distance from the crossing's edge to its end wall, m."""
    width: Annotated[float, Field(ge=0.6, le=6)] | None = None
    """Distance between its walls, m; default: that of the corridor that it continues, this segment or the next."""


class Segment(Part):
    """A straight piece of corridor."""

    length: Annotated[float, Field(ge=1, le=200)]
    """Its length along the middle line from node to node, m."""
    width: Annotated[float, Field(ge=0.6, le=6)] = 2.0
    """Distance between its walls, m."""
    then: Literal["end", "left", "right", "straight"] = "end"
    """How the route goes on: an end wall, a 90 degree turn, or straight on into the next segment."""
    branches: tuple[Branch, ...] = ()
    """Ways at its end that the route does not take."""
    sign: bool = True
    """Whether a crossing has a marker that faces the car and tells the turn: id 40 left, 41 right, 42 straight on."""
    doors: tuple[Door, ...] = ()
    """Doors in its walls."""
    cupboards: tuple[Cupboard, ...] = ()
    """Cupboards along its walls."""
    obstacles: tuple[Obstacle, ...] = ()
    """Boxes on its floor."""
    gates: tuple[Gate, ...] = ()
    """Gates that the route leads through."""
    tapes: tuple[Tape, ...] = ()
    """Strips of tape on its floor."""


class Start(Part):
    """Where the middle of the car's rear axle stands at first, in the first segment."""

    at: NotNegative = 1.0
    """Its place, m along the segment."""
    offset: float = 0.0
    """Its place, m left of the middle line."""
    heading_deg: Annotated[float, Field(ge=-30, le=30)] = 0.0
    """Heading of the car, counter-clockwise from the segment's direction, deg."""


class Course(Part):
    """A course: corridors, what stands in them, where the car starts and where its goal is."""

    schema_: str | None = Field(default=None, alias="$schema", exclude=True)
    """JSON Schema of course files, for editors."""
    name: Annotated[str, Field(min_length=1)]
    """Its name, for lists and error messages."""
    description: str = ""
    """Its purpose, in a sentence."""
    segments: Annotated[tuple[Segment, ...], Field(min_length=1)]
    """Its segments, in the order of the route."""
    start: Start = Start()
    """Where the car stands at first."""
    goal: Annotated[float, Field(ge=0.5, le=20)] = 1.0
    """The goal line lies this far before the end wall, m; a closed course has its goal at the start."""
    closed: bool = False
    """Whether the last segment turns into the first one again."""
    laps: Annotated[int, Field(ge=1, le=100), BeforeValidator(json_text.whole)] = 1
    """How often a closed course is driven."""

    @classmethod
    def load(cls, path: str | Path) -> Course:
        """Read a course file.

        Args:
            path: a JSON file after `course.schema.json`.

        Raises:
            UnreadableCourseError: the file cannot be opened.
            CourseError: it is no text or no JSON, or has problems; the message lists all, each with its place, what was
                got and what is allowed.
        """
        try:
            text = json_text.read(path)
        except UnicodeDecodeError as error:
            raise CourseError(f"{path}: {json_text.unread(error)}") from None
        except (OSError, ValueError) as error:  # a name with a null is a ValueError
            raise UnreadableCourseError(f"{path}: cannot be read: {json_text.unread(error)}") from error
        return cls.parse(text, source=str(path))

    @classmethod
    def parse(cls, text: str, source: str = "course") -> Course:
        """Read a course from JSON text; `source` names it in errors.

        Raises:
            CourseError: as for `load`.
        """
        value = json_text.loads(text, source, CourseError)
        if isinstance(value, dict) and "states" in value and "segments" not in value:
            raise CourseError(f"{source}: a state machine, not a course: `tral drive --policy` takes it")
        try:
            course = cls.model_validate_json(text.removeprefix("\ufeff"), strict=True)
        except ValidationError as error:
            raise _report(source, map(_sentence, filter(_is_cause, error.errors()))) from None
        return course.checked(source)

    def checked(self, source: str | None = None) -> Course:
        """Check that the parts of this course fit together, and give it back.

        Raises:
            CourseError: they do not; the message lists all problems, each with its place.
        """
        problems = [*find_problems(self)]
        if problems:
            raise _report(source or f"course '{self.name}'", problems)
        return self

    def save(self, path: str | Path) -> None:
        """Write a course file as a whole; members that have their default value are left out.

        Raises:
            CourseError: the file cannot be written; an old one is still there.
        """
        try:
            atomic.write_bytes(Path(path), self.to_json().encode())
        except (OSError, ValueError) as error:  # a name with a null is a ValueError
            raise CourseError(f"{path}: cannot be written: {getattr(error, 'strerror', error)}") from error

    def to_json(self) -> str:
        """The course as indented JSON text, without members that have their default value."""
        return json.dumps(self.model_dump(mode="json", exclude_defaults=True), indent=2) + "\n"


def course_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of course files; `course.schema.json` holds the same."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Course.model_json_schema()}


def example_path(name: str) -> Path:
    """Path of a course that comes with the package.

    Raises:
        CourseError: no such course.
    """
    if name not in example_names():
        raise CourseError(f"no course '{name}': {nearest(name, example_names())}")
    return Path(__file__).parent / "examples" / f"{name}.json"


def example_names() -> list[str]:
    """Names of the courses that come with the package, sorted."""
    return sorted(path.stem for path in (Path(__file__).parent / "examples").glob("*.json"))


def find_problems(course: Course) -> Iterable[str]:
    """Tell what does not fit together in a course whose members are each allowed, a sentence for each problem."""
    last = len(course.segments) - 1
    ids = [gate.id for segment in course.segments for gate in segment.gates]
    for i, segment in enumerate(course.segments):
        where = f"/segments/{i}"
        if i < last and segment.then == "end":
            yield f"{where}/then: got 'end' before the last segment. Allowed: left, right, straight"
        if i == last and not course.closed and segment.then != "end":
            yield f"{where}/then: got '{segment.then}' in the last segment. Allowed: end (or \"closed\": true)"
        if i == last and course.closed and segment.then not in ("left", "right"):
            yield f"{where}/then: got '{segment.then}' in the last segment of a closed course. Allowed: left, right"
        yield from _branch_problems(where, segment)
        yield from _furniture_problems(where, segment)
        for k, gate in enumerate(segment.gates):
            if ids.count(gate.id) > 1:
                yield f"{where}/gates/{k}/id: got {gate.id}, which more than one gate has. Allowed: unique ids"
    if course.laps > 1 and not course.closed:
        yield f'/laps: got {course.laps} for an open course. Allowed: 1 (or "closed": true)'
    half = course.segments[0].width / 2
    if abs(course.start.offset) > half - 0.15:
        yield f"/start/offset: got {course.start.offset:g}. Allowed: within {half - 0.15:g} of the middle line"
    if course.start.at > course.segments[0].length:
        yield f"/start/at: got {course.start.at:g}. Allowed: 0 to {course.segments[0].length:g}, the segment's length"


def _branch_problems(where: str, segment: Segment) -> Iterable[str]:
    if segment.then == "end" and segment.branches:
        yield f"{where}/branches: got {len(segment.branches)} at an end wall. Allowed: none"
    taken = [segment.then]
    for k, branch in enumerate(segment.branches):
        if branch.to in taken:
            free = [way for way in ("left", "right", "straight") if way not in taken]
            yield f"{where}/branches/{k}/to: got '{branch.to}', which is taken. Allowed: {', '.join(free) or 'none'}"
        taken.append(branch.to)


_AT_WALLS = ("doors", "cupboards")


def _furniture_problems(where: str, segment: Segment) -> Iterable[str]:
    half = segment.width / 2
    for kind in ("doors", "cupboards", "obstacles", "gates", "tapes"):
        for k, item in enumerate(getattr(segment, kind)):
            if item.at > segment.length:
                yield f"{where}/{kind}/{k}/at: got {item.at:g}. Allowed: 0 to {segment.length:g}, the segment's length"
            if kind not in _AT_WALLS and abs(item.offset) > half:
                yield f"{where}/{kind}/{k}/offset: got {item.offset:g}. Allowed: -{half:g} to {half:g}"
    for kind, k, what, got, limit in _extents(segment):
        if got > limit:
            yield f"{where}/{kind}/{k}/length: got {got:g}. Allowed: {limit:g} at most, {what} of the segment"
    for k, cupboard in enumerate(segment.cupboards):
        if cupboard.depth >= segment.width:
            yield f"{where}/cupboards/{k}/depth: got {cupboard.depth:g}. Allowed: below the width of {segment.width:g}"


def _extents(segment: Segment) -> Iterable[tuple[str, int, str, float, float]]:
    """Kind, number, what bounds it, length and bound of what has a length: cupboards and tapes."""
    for k, cupboard in enumerate(segment.cupboards):
        yield "cupboards", k, "the length", cupboard.length, segment.length
    for k, tape in enumerate(segment.tapes):
        limit = ("the width", segment.width) if tape.across else ("the length", segment.length)
        yield "tapes", k, limit[0], tape.length, limit[1]


def _report(source: str, problems: Iterable[str]) -> CourseError:
    return CourseError(problem_report(source, list(problems)))


def _is_cause(error: Any) -> bool:
    # A list with a bad item is also reported as too short; the item says more.
    return not (error["type"] == "too_short" and error["input"])


def _sentence(error: Any) -> str:
    steps, annotation, owner = validation_text.place(Course, error)
    place = "".join(f"/{step}" for step in steps) or "/"
    name, got = str(steps[-1]) if steps else "", error["input"]
    if error["type"] == "extra_forbidden":
        return f"{place}: unknown member '{name}': {nearest(name, validation_text.names(owner))}"
    if error["type"] == "missing":
        return f"{place}: missing. Members here: {', '.join(validation_text.names(owner))}"
    if error["type"] == "literal_error":
        return f"{place}: got {got!r}: {nearest(got, validation_text.choices(annotation))}"
    rule = validation_text.allowed(annotation, error, _WORDS)
    in_metres = bool(re.search(r"\bm\b", _description(owner, name)))
    return f"{place}: got {json.dumps(got, default=str)[:60]}. Allowed: {rule}{_unit_or_quotes(error, in_metres)}"


def _description(owner: Any, name: str) -> str:
    """What is said of a member: its meaning, with its unit."""
    models = (getattr(kind, "model_fields", {}) for kind in validation_text.members(owner))
    return next((model[name].description or "" for model in models if name in model), "")


def _unit_or_quotes(error: Any, in_metres: bool) -> str:
    """What may be wrong with a number, as the end of a sentence: it is quoted, or in mm or cm; empty: not known."""
    got = error["input"]
    if error["type"] in ("float_type", "int_type") and isinstance(got, str) and re.fullmatch(r"-?\d+([.,]\d+)?", got):
        return f", without quotes: {got.replace(',', '.')}"
    return "; lengths are in m" if error["type"] == "less_than_equal" and in_metres else ""


_WORDS = {
    **validation_text.WORDS,
    "greater_than": "greater than {gt:g}",
    "greater_than_equal": "greater than or equal to {ge:g}",
    "less_than_equal": "less than or equal to {le:g}",
    "too_short": "a list of at least 1 item",
    "string_too_short": "at least 1 character",
    "tuple_type": "a list",
    "bool_type": "true, false",
    "string_type": "a string",
}
"""What is allowed, where course files have words of their own."""
