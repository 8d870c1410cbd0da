"""A machine as a UMLet file."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Any
from xml.sax.saxutils import escape

from tral_fsm.definition.machine import MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.draw.layered.arrange import arrange
from tral_fsm.draw.layered.shapes import Arrangement, Rect, Route
from tral_fsm.formats.tral_json import members, state_json
from tral_fsm.formats.umlet.elements import without_drawing
from tral_fsm.formats.xml_tree import json_text, legal

_LINE, _LETTER = 18, 7.5
"""Height of a line and width of a letter in UMLet at 100 %, px."""
_NODE = 20
"""Size of an initial node, px."""
_MARGIN = 10
"""Distance of an arrow's points from the edges of its box, px. Source: UMLet."""

_RULES = ("--", "-.", "..", "==")
"""Lines that UMLet draws as rules. Source: UMLet."""

Point = tuple[float, float]


def dumps(machine: MachineDefinition) -> str:
    """Write a machine.

    Args:
        machine: the definition.

    Returns:
        XML text with a layout: an arrow for each transition, its ends on the outlines of its states.
    """
    drawn = arrange(machine, state_size=_state_size, label_size=_label_size, direction="right", bundled=False)
    placed = zip(drawn.boxes, machine.states, strict=True)
    found = [element("UMLState", box, _state_text(state)) for box, state in placed]
    found += _root(drawn)
    order: Counter[int | str] = Counter()
    leaving = Counter(transition.source for transition in machine.transitions)
    for transition, route in zip(machine.transitions, drawn.routes, strict=True):
        order[transition.source] += 1
        number = order[transition.source] if leaving[transition.source] > 1 else None
        found.append(_arrow(_transition_text(transition, number), route))
    return diagram(found, _head(machine))


def _root(drawn: Arrangement) -> list[str]:
    """The initial node and its arrow."""
    x, y = drawn.root[0]
    node = Rect(x - _NODE, y - _NODE // 2, _NODE, _NODE)
    return [element("UMLSpecialState", node, "type=initial"), relation("lt=->", drawn.root)]


def _arrow(text: str, route: Route) -> str:
    """An arrow whose text stands in its room of the layout.

    UMLet centres the text on the middle one of the arrow's lines. So that line runs along the room, and as many empty
    lines as the text has push the text above it, or below it for an arrow from a state to itself.
    """
    label, points = route.label, [(float(x), float(y)) for x, y in route.points]
    line, _, rest = text.partition("\n")
    empty = "\n" * (text.count("\n") + 1)
    for index, ((x, y), (u, v)) in enumerate(pairwise(points)):
        begin, end = label.x, label.x + label.w
        if y == v and 0 <= y - label.y - label.h <= 4 and min(x, u) <= begin and end <= max(x, u):
            first, last = ((begin, y), (end, y)) if x < u else ((end, y), (begin, y))
            before, after = _parted([*points[: index + 1], first]), _parted([*reversed(points[index + 1 :]), last])
            most = max(len(before), len(after))
            return relation(text + empty, [*_longer(before, most), *reversed(_longer(after, most))])
    return relation(f"{line}\n{empty}{rest}", points)


def _parted(points: list[Point]) -> list[Point]:
    """Points without those that repeat the one before."""
    return [point for index, point in enumerate(points) if index == 0 or point != points[index - 1]]


def _longer(points: list[Point], count: int) -> list[Point]:
    """The same way with more points: its first line is halved until there are `count`."""
    while len(points) < count:
        (x, y), (u, v) = points[:2] if len(points) > 1 else points * 2
        points = [points[0], ((x + u) / 2.0, (y + v) / 2.0), *points[1:]]
    return points


def diagram(elements: list[str], text: str = "") -> str:
    """Text of a file with these elements; `text` is that of the diagram itself."""
    head = f"  <help_text>{escape(text)}</help_text>\n" if text else ""
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="no"?>\n<diagram program="umlet" version="15.1">\n'
        f"{head}  <zoom_level>10</zoom_level>\n{''.join(elements)}</diagram>\n"
    )


def element(kind: str, box: Rect, text: str, points: str = "") -> str:
    """One element."""
    sides = "".join(
        f"      <{side}>{length}</{side}>\n" for side, length in zip("xywh", (box.x, box.y, box.w, box.h), strict=True)
    )
    return (
        f"  <element>\n    <id>{kind}</id>\n    <coordinates>\n{sides}    </coordinates>\n"
        f"    <panel_attributes>{escape(text)}</panel_attributes>\n"
        f"    <additional_attributes>{points}</additional_attributes>\n  </element>\n"
    )


def relation(text: str, points: Sequence[Point]) -> str:
    """An arrow through points, px."""
    left, top = (int(min(point[axis] for point in points)) - _MARGIN for axis in (0, 1))
    width, height = (round(max(point[axis] for point in points) - low + _MARGIN) for axis, low in ((0, left), (1, top)))
    inside = ";".join(f"{x - left:.1f};{y - top:.1f}" for x, y in points)
    return element("Relation", Rect(left, top, width, height), text, inside)


def parameters(values: dict[str, Any]) -> str:
    """JSON members, each on a line."""
    lines = [f"{json.dumps(name, ensure_ascii=False)}: {_broken(value)}" for name, value in values.items()]
    return json_text(",\n".join(lines))


def _broken(value: Any) -> str:
    """JSON with a line for each object of an array."""
    if isinstance(value, dict):
        return (
            "{"
            + ", ".join(f"{json.dumps(key, ensure_ascii=False)}: {_broken(item)}" for key, item in value.items())
            + "}"
        )
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(_broken(item) for item in value) + "]"
    return json.dumps(value, ensure_ascii=False)


def state_text(title: str, values: dict[str, Any]) -> str:
    """Title, rule, parameters, rule."""
    line = " ".join(legal(title).split())
    return f"{'' if line == '--' else line}\n--\n{parameters(values)}\n--\nhalign=left"


def lost_titles(machine: MachineDefinition) -> list[str]:
    """A sentence for each state whose name UMLet would read as a command: a diagram shows the state without a title."""
    titles = {state.id: state.label or str(state.id) for state in machine.states}
    return [
        f"state {name!r}: UMLet reads the title {title[:60]!r} as a command and does not show it: give the state "
        "another label"
        for name, title in titles.items()
        if title.strip() in _RULES or " ".join(without_drawing(title).split()) != " ".join(title.split())
    ]


def _head(machine: MachineDefinition) -> str:
    said = {name: getattr(machine, name) for name in ("name", "description") if getattr(machine, name)}
    return "".join(f"// {json_text(json.dumps({k: v}, ensure_ascii=False)[1:-1])}\n" for k, v in said.items())


def _state_text(state: StateSpec) -> str:
    return state_text(state.label or str(state.id), state_json(state))


def _transition_text(transition: TransitionSpec, order: int | None) -> str:
    when = transition.when
    ends = {"from": transition.source, "to": transition.target}
    place = {} if order is None else {"order": order}
    return "lt=->\n" + parameters({"id": transition.id, "type": when.type, **ends, **place, **members(when)})


def _state_size(state: StateSpec) -> tuple[int, int]:
    return size(_state_text(state))


def _label_size(transitions: Sequence[TransitionSpec], places: Sequence[str]) -> tuple[int, int]:
    lines = [line for t in transitions for line in _transition_text(t, 1).split("\n")[1:]]  # "lt=->" is not drawn
    return _round_up(_wide(lines)), _high(lines)


def size(text: str) -> tuple[int, int]:
    """Width and height of a box for a text without its last line, px, in steps of 10; it is not wider than 600 px."""
    lines = [line for line in text.split("\n")[:-1] if not line.startswith("//")]
    return int(max(100.0, min(_wide(lines), 600.0))) // 10 * 10, _high(lines)


def _wide(lines: Sequence[str]) -> float:
    return max((len(line) for line in lines), default=0) * _LETTER + 20


def _high(lines: Sequence[str]) -> int:
    return (len(lines) * _LINE + 10) // 10 * 10 + 10


def _round_up(length: float) -> int:
    return -int(-length // 10) * 10
