"""From a UMLet diagram in either file format to a machine: states by their text, ends of arrows by text or place."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tral_env.checks import is_number
from tral_fsm.formats import members, units2016
from tral_fsm.formats.plain import MIN_PLAIN_STATES, Plain, Problems

MAX_GAP_PX = 9.0
"""Largest gap between the end of an arrow and the outline of its state, px at 100 %. Source: UMLet."""
FULL_ZOOM = 10.0
"""The zoom_level for 100 %."""
MAX_ELEMENTS = 1500
"""Largest number of elements. Source: choice; the machine office has 60."""

_STATE = ("UMLState", "State", "StateSubDiagram")
_ARROW = ("Relation",)
_INITIAL, _FINAL, _SPECIAL = "InitialState", "FinalState", "UMLSpecialState"
_COMMENT = ("UMLNote", "Note", "Text", "UMLFrame", "Frame")
"""Elements without a meaning for the machine."""
_SETTING = re.compile(
    r"\s*(?:"
    r"(?:lt|bg|fg|lw|layer|group|halign|valign|fontsize|style|elementstyle|transparency|symbol|autoresize"
    r"|cbase|cpos|m1pos|m2pos|r1pos|r2pos)\s*=\s*(?:\[[^\]]*\]|[^\s\[])*(?P<rest>.*)"
    r"|(?:c|m1|m2|r1|r2|q1|q2|fontfamily|template|customelement)\s*=.*"
    r")"
)
"""A line of text that sets UMLet's drawing; `rest` is what stands behind a setting of one word. Source: UMLet."""


_MAX_NESTED = 200
"""So many states are looked at for states within states, so that an error is not slow. Source: choice."""
_HAS_TYPE = re.compile(r'^[ \t]*"?type"?[ \t]*[:=]|[\s,{]"?type"?[ \t]*:', re.MULTILINE)
_PLAIN_CHART = (
    "a plain chart: no state has a `type:`. Drag states and transitions from the palette (TRAL_State-Machine.uxf), or "
    "begin with `tral fsm new my.uxf`"
)


@dataclass(frozen=True)
class Element:
    """An element of a diagram, as in the file."""

    kind: str
    """UMLState, Relation, ...; in a legacy file the name without its package."""
    text: str
    """Panel attributes."""
    box: tuple[float, float, float, float] | None
    """x, y, width, height, px at the file's zoom; None: not readable."""
    points: tuple[tuple[float, float], ...]
    """Points of a Relation, relative to x, y."""
    legacy: bool
    """Whether the points are in px at the file's zoom, not at 100 %."""


@dataclass(frozen=True)
class Diagram:
    """A whole file."""

    elements: Sequence[Element]
    zoom: float = FULL_ZOOM
    text: str = ""
    """The text of the diagram itself."""


@dataclass(frozen=True)
class _Outline:
    """Outline of an element at which an arrow may end, px at 100 %."""

    kind: str
    number: int
    box: tuple[float, float, float, float]

    def distance(self, point: tuple[float, float]) -> float:
        """Distance of a point from the outline, px."""
        x, y, width, height = self.box
        across = max(x - point[0], 0.0, point[0] - x - width)
        down = max(y - point[1], 0.0, point[1] - y - height)
        if across or down:
            return math.hypot(across, down)
        return min(point[0] - x, x + width - point[0], point[1] - y, y + height - point[1])

    def holds(self, other: _Outline) -> bool:
        """Whether another element is drawn within this one."""
        (x, y, width, height), (a, b, across, down) = self.box, other.box
        larger = width * height > across * down
        return larger and x <= a and y <= b and a + across <= x + width and b + down <= y + height


def plain(diagram: Diagram, problems: Problems) -> Plain:
    """The machine that a diagram shows.

    Args:
        diagram: its elements.
        problems: takes the problems of the diagram.

    Returns:
        Values as in TRAL JSON, and the element of each.
    """
    if len(diagram.elements) > MAX_ELEMENTS:
        problems.complain("", f"got {len(diagram.elements)} elements, at most {MAX_ELEMENTS} are read")
        return Plain()
    for number, element in enumerate(diagram.elements, 1):
        if len(element.text) > members.MAX_CHARACTERS:
            told = f"got {len(element.text)} characters, at most {members.MAX_CHARACTERS} are read"
            problems.complain("", told, f"{element.kind[:60]} (element {number})")
            return Plain()
    return _Reading(diagram, problems).machine()


class _Reading:
    """Turns the elements of a diagram into states and transitions."""

    def __init__(self, diagram: Diagram, problems: Problems) -> None:
        self.diagram = diagram
        self.problems = problems
        self.places: dict[str, str] = {"": "diagram"}
        self.states: list[dict[str, Any]] = []
        self.transitions: list[dict[str, Any]] = []
        self.orders: list[Any] = []
        self.roots: dict[int, Any] = {}
        """Number of the element that names a root -> id of the root."""
        self.at: dict[int, int] = {}
        """Number of an element -> index of its state."""
        self.titles: dict[int, str] = {}
        """Number of an element -> title of its state."""
        self.outlines: list[_Outline] = []

    def machine(self) -> Plain:
        """The machine; states come first, since arrows point at them."""
        kinds = {number: _special(element) for number, element in enumerate(self.diagram.elements, 1)}
        texts = [element.text for number, element in enumerate(self.diagram.elements, 1) if kinds[number] in _STATE]
        if len(texts) >= MIN_PLAIN_STATES and not any(map(_HAS_TYPE.search, texts)):
            self.problems.plain_chart = _PLAIN_CHART
        for number, element in enumerate(self.diagram.elements, 1):
            kind = kinds[number]
            if kind in _STATE:
                self.state(number, element)
            elif kind not in (*_ARROW, *_COMMENT, _INITIAL, _FINAL):
                allowed = "UMLState, Relation, UMLSpecialState type=initial or type=final, UMLNote, Text"
                self.problems.complain("", f"got {kind[:60]!r}. Allowed: {allowed}", f"element {number}")
            if kind not in _ARROW and element.box is not None:
                self.outlines.append(_Outline(kind, number, self.scaled(element.box)))
        self.repeated_states()
        if self.problems.plain_chart:
            self.problems.plain_chart += self.nested()
        for number, element in enumerate(self.diagram.elements, 1):
            if kinds[number] in _ARROW:
                self.arrow(number, element)
        self.in_order()
        self.transitions = units2016.with_ids(_without_repeated(self.transitions))
        value = {**self.head(), "states": self.states, "transitions": self.transitions}
        value["root"] = self.root()
        return Plain(units2016.modern(value, self.problems), self.places)

    def complain(self, pointer: str, message: str) -> None:
        """Report a problem of an element, before transitions change places."""
        self.problems.complain(pointer, message, self.places.get(pointer, ""))

    def scaled(self, box: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
        """A box in px at 100 %."""
        x, y, width, height = (length * FULL_ZOOM / self.diagram.zoom for length in box)
        return x, y, width, height

    def head(self) -> dict[str, Any]:
        """Members of the machine in the text of the diagram, beside what is for UMLet."""
        said = []
        for number, line in enumerate(self.diagram.text.split("\n"), 1):
            plain_line = line.strip().removeprefix("//").strip()
            if re.match(r'"?(?:name|description|units)"?[ \t]*:', plain_line):
                said.append(plain_line)
            elif line.strip() and without_drawing(line).strip():
                got = f"got {line.strip()[:60]!r} in line {number} of its text"
                self.complain("", f"{got}. Allowed: name, description, units, comments (//)")
        return members.parse("\n".join(said), lambda fault: self.complain("", fault))

    def state(self, number: int, element: Element) -> None:
        """A state: title, rule, parameters."""
        title, body = sections(element.text)
        pointer = f"/states/{len(self.states)}"
        self.places[pointer] = (
            f"UMLState '{title[:60]}' (element {number})" if title else f"UMLState (element {number})"
        )
        found = members.parse(body, lambda fault: self.complain(pointer, fault))
        if not found:
            self.complain(pointer, "got no parameters: they stand below a line --")
        if "id" not in found and title:
            found["id"] = members.word(title)
        if "root" in found:
            is_root = found.pop("root")
            if is_root is True:
                self.roots[number] = found.get("id")
            elif is_root is not False:
                self.complain(pointer, f"got root: {is_root!r}, expected true or false")
        self.at[number] = len(self.states)
        self.titles[number] = title
        self.states.append(found)

    def repeated_states(self) -> None:
        """Let a further copy of a state of the palette, whose id is its type, have its title or a number as its id."""
        taken = {str(state.get("id")) for state in self.states}
        seen: set[str] = set()
        for number, index in self.at.items():
            state = self.states[index]
            name = str(state.get("id"))
            if name in seen and name == state.get("type"):
                title = self.titles[number]
                copies = (f"{name} {count}" for count in itertools.count(2))
                state["id"] = title if title and title not in taken else next(c for c in copies if c not in taken)
                taken.add(str(state["id"]))
                if number in self.roots:
                    self.roots[number] = state["id"]
            seen.add(name)

    def nested(self) -> str:
        """States that are drawn within other ones, in words."""
        states = [outline for outline in self.outlines if outline.number in self.at][:_MAX_NESTED]
        found = [
            f"'{self.titles[inner.number][:40]}' in '{self.titles[outer.number][:40]}'"
            for inner in states
            for outer in states
            if inner is not outer and outer.holds(inner)
        ]
        more = f" and {len(found) - 3} more" if len(found) > 3 else ""
        told = f". States within states are not read ({', '.join(found[:3])}{more}): an FSMState holds a machine"
        return told if found else ""

    def arrow(self, number: int, element: Element) -> None:
        """A transition, or the arrow of an initial or final node."""
        body = "\n".join(map(without_drawing, element.text.split("\n")))
        pointer = f"/transitions/{len(self.transitions)}"
        faults: list[str] = []
        found = members.parse(body, faults.append)
        tail, head = self.ends(element)
        self.places[pointer] = self.arrow_place(number, found, tail, head)
        for fault in faults:
            self.complain(pointer, fault)
        kinds = [end.kind if end else "" for end in (tail, head)]
        if not found and any(kind in _COMMENT for kind in kinds):
            return  # the line of a comment
        if _INITIAL in kinds or _FINAL in kinds:
            self.node(pointer, found, tail, head)
            return
        directed = _direction(element.text)
        why = "that end touches no outline of a state" if directed else "a line without a head (lt=->) does not tell it"
        for key, end in (("from", tail), ("to", head)):
            self.end(pointer, found, key, end if directed else None, why)
        self.orders.append(found.pop("order", None))
        self.transitions.append(found)

    def arrow_place(self, number: int, found: dict[str, Any], tail: _Outline | None, head: _Outline | None) -> str:
        """An arrow in words: by its id, else by the states at its ends."""
        if "id" in found:
            return f"Relation '{str(found['id'])[:60]}' (element {number})"
        ends = [self.end_name(found.get(key), end) for key, end in (("from", tail), ("to", head))]
        if ends == ["?", "?"]:
            return f"Relation (element {number})"
        return f"Relation {ends[0]} > {ends[1]} (element {number})"

    def end_name(self, said: Any, drawn: _Outline | None) -> str:
        """Name of the state at an end of an arrow, or the kind of another element there."""
        if drawn is not None and drawn.number in self.at:
            said = self.titles[drawn.number] or self.states[self.at[drawn.number]].get("id", said)
        if said is not None:
            return f"'{str(said)[:40]}'"
        return drawn.kind if drawn else "?"

    def node(self, pointer: str, found: dict[str, Any], tail: _Outline | None, head: _Outline | None) -> None:
        """An arrow from the initial node names the root, an arrow to a final node a state that may end."""
        if found:
            self.complain(pointer, f"got parameters at an initial or final node: {', '.join(found)[:60]}")
        if tail and head and tail.kind == _INITIAL and head.number in self.at:
            self.roots[tail.number] = self.states[self.at[head.number]].get("id")
        elif tail and head and head.kind == _FINAL and tail.number in self.at:
            self.states[self.at[tail.number]].setdefault("final", True)
        else:
            self.complain(pointer, "expected an arrow from an initial node to a state, or from a state to a final node")

    def ends(self, element: Element) -> tuple[_Outline | None, _Outline | None]:
        """Outlines at the tail and the head of an arrow."""
        if element.box is None or not element.points:
            return None, None
        x, y = element.box[:2]
        scale = FULL_ZOOM / self.diagram.zoom
        points = [
            ((x + a) * scale, (y + b) * scale) if element.legacy else (x * scale + a, y * scale + b)
            for a, b in (element.points[0], element.points[-1])
        ]
        first, last = (self.near(point) for point in points)
        return (last, first) if _direction(element.text) == "first" else (first, last)

    def near(self, point: tuple[float, float]) -> _Outline | None:
        """The nearest outline of a point, a state's before a comment's; None: there is none, or two are as near."""
        found = [(outline.distance(point), outline) for outline in self.outlines]
        near = [(outline.kind in _COMMENT, distance, outline) for distance, outline in found if distance <= MAX_GAP_PX]
        near.sort(key=lambda one: one[:2])
        if not near or (len(near) > 1 and near[0][:2] == near[1][:2]):
            return None
        return near[0][2]

    def end(self, pointer: str, found: dict[str, Any], key: str, drawn: _Outline | None, why: str) -> None:
        """One end of a transition: as in the text, which must agree with the drawing, else as drawn."""
        state = self.states[self.at[drawn.number]] if drawn and drawn.number in self.at else None
        if state is None or "id" not in state:
            if key not in found:
                self.missing(pointer, key, f"and {why}")
                found[key] = None
            return
        if key not in found:
            found[key] = state["id"]
        elif str(found[key]) != str(state["id"]):
            place = self.places[f"/states/{self.at[drawn.number]}"] if drawn else ""
            self.complain(pointer, f"says {key!r}: {found[key]!r}, but that end is drawn at {place}")

    def missing(self, pointer: str, key: str, why: str) -> None:
        """Report a missing key; the reader does not report it again."""
        self.problems.complain(f"{pointer}/{key}", f"{key!r} is missing, {why}", self.places[pointer])

    def in_order(self) -> None:
        """Sort the transitions of each state by their order, within the places that they have."""
        groups: dict[str, list[int]] = {}
        for index, (order, transition) in enumerate(zip(self.orders, self.transitions, strict=True)):
            if order is not None and not is_number(order):
                self.complain(f"/transitions/{index}", f"got order: {order!r}, expected a number")
                return
            groups.setdefault(str(transition.get("from")), []).append(index)
        sorted_to: dict[int, int] = {}
        for group in groups.values():
            wanted = sorted(group, key=lambda index: math.inf if self.orders[index] is None else self.orders[index])
            sorted_to |= dict(zip(group, wanted, strict=True))
        places = {index: self.places[f"/transitions/{index}"] for index in sorted_to}
        self.transitions = [self.transitions[sorted_to[index]] for index in range(len(self.transitions))]
        self.places |= {f"/transitions/{index}": places[sorted_to[index]] for index in sorted_to}

    def root(self) -> Any:
        """Id of the root."""
        ids = list(dict.fromkeys(map(str, self.roots.values())))
        if len(ids) > 1:
            self.complain("", f"got {len(ids)} roots: {', '.join(ids)[:60]}; exactly one is allowed")
        elif not ids:
            self.missing("", "root", 'let an initial node point to it, or give one state "root": true')
        return next(iter(self.roots.values()), None)


def _without_repeated(transitions: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Transitions in which a further copy of one of the palette, whose id is its type, has no id."""
    seen: set[str] = set()
    found = []
    for transition in transitions:
        name = str(transition.get("id"))
        copy = name in seen and name == transition.get("type")
        found.append({key: value for key, value in transition.items() if key != "id"} if copy else transition)
        seen.add(name)
    return found


def _special(element: Element) -> str:
    """Kind of an element; that of a UMLSpecialState includes its type."""
    if element.kind != _SPECIAL:
        return element.kind
    found = re.search(r"^[ \t]*type[ \t]*=[ \t]*(\w+)", element.text, re.MULTILINE)
    kind = found[1] if found else "decision"
    return {"initial": _INITIAL, "final": _FINAL}.get(kind, f"{_SPECIAL} type={kind}")


def sections(text: str) -> tuple[str, str]:
    """Title and parameters of a state's text: above and below its first rule; a further rule is only a line.

    Blank lines before the parameters keep their line numbers.
    """
    lines = [without_drawing(line) for line in text.replace("\r\n", "\n").split("\n")]
    rules = [index for index, line in enumerate(lines) if line.strip() == "--"]
    first = rules[0] if rules else len(lines)
    title = " ".join(" ".join(lines[:first]).split())
    below = ["" if line.strip() == "--" else line for line in lines[first + 1 :]]
    return title, "\n" * (first + 1) + "\n".join(below)


def without_drawing(line: str) -> str:
    """A line of text without a comment and without what sets UMLet's drawing; the rest behind a setting stays."""
    if line.lstrip().startswith("//"):
        return ""
    setting = _SETTING.fullmatch(line)
    rest = line if setting is None else (setting["rest"] or "").strip()
    return "" if setting is not None and rest.startswith("//") else rest


def _direction(text: str) -> str:
    """Point with the head of an arrow: "first" or "last"; empty: neither, or both."""
    found = re.search(r"^[ \t]*lt[ \t]*=[ \t]*(\S{1,9})", text, re.MULTILINE)
    line = found[1] if found else ""
    first, last = line.startswith("<"), line.endswith(">")
    return "" if first == last else "first" if first else "last"
