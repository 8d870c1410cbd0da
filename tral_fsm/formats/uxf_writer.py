"""A machine as a UMLet file."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any
from xml.sax.saxutils import escape

from tral_fsm.definition import MachineDefinition, TransitionSpec
from tral_fsm.formats.grid import Box, arrows, boxes
from tral_fsm.formats.tral_json import members, state_json
from tral_fsm.formats.xml_tree import json_text, legal

_LINE, _LETTER = 18, 7.5
"""Height of a line and width of a letter in UMLet at 100 %, px."""
_NODE = 20
"""Size of an initial node, px."""
_MARGIN = 10
"""Points of an arrow begin so far inside its box, px. Source: UMLet."""

Point = tuple[float, float]


def dumps(machine: MachineDefinition) -> str:
    """Write a machine.

    Args:
        machine: the definition.

    Returns:
        XML text. States stand in layers below the root; an arrow's ends lie on their states' outlines.
    """
    texts = [_state_text(machine, index) for index in range(len(machine.states))]
    placed = boxes(machine, [_size(text) for text in texts])
    found = [element("UMLState", box, text) for box, text in zip(placed, texts, strict=True)]
    index = {state.id: number for number, state in enumerate(machine.states)}
    root = placed[index[machine.root]]
    start = Box(root.x - 80, root.y, _NODE, _NODE)
    found.append(element("UMLSpecialState", start, "type=initial"))
    found.append(relation("lt=->", [(start.x + _NODE, start.y + 10), (root.x, root.y + 10)]))
    ends = [(index[t.source], index[t.target]) for t in machine.transitions]
    leaving = Counter(t.source for t in machine.transitions)
    order: Counter[int | str] = Counter()
    for transition, points in zip(machine.transitions, arrows(placed, ends), strict=True):
        order[transition.source] += 1
        number = order[transition.source] if leaving[transition.source] > 1 else None
        found.append(relation(_transition_text(transition, number), points))
    return diagram(found, _head(machine))


def diagram(elements: list[str], text: str = "") -> str:
    """A whole file of elements; `text` is what the diagram says of itself."""
    head = f"  <help_text>{escape(text)}</help_text>\n" if text else ""
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="no"?>\n<diagram program="umlet" version="15.1">\n'
        f"{head}  <zoom_level>10</zoom_level>\n{''.join(elements)}</diagram>\n"
    )


def element(kind: str, box: Box, text: str, points: str = "") -> str:
    """One element."""
    sides = "".join(
        f"      <{side}>{round(length)}</{side}>\n"
        for side, length in zip("xywh", (box.x, box.y, box.width, box.height), strict=True)
    )
    return (
        f"  <element>\n    <id>{kind}</id>\n    <coordinates>\n{sides}    </coordinates>\n"
        f"    <panel_attributes>{escape(text)}</panel_attributes>\n"
        f"    <additional_attributes>{points}</additional_attributes>\n  </element>\n"
    )


def relation(text: str, points: list[Point]) -> str:
    """An arrow through points in pixels."""
    left, top = (int(min(point[axis] for point in points)) - _MARGIN for axis in (0, 1))
    width, height = (max(point[axis] for point in points) - low + _MARGIN for axis, low in ((0, left), (1, top)))
    inside = ";".join(f"{x - left:.1f};{y - top:.1f}" for x, y in points)
    return element("Relation", Box(left, top, width, height), text, inside)


def parameters(values: dict[str, Any]) -> str:
    """JSON members, one a line."""
    lines = [f"{json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}" for name, value in values.items()]
    return json_text(",\n".join(lines))


def state_text(title: str, values: dict[str, Any]) -> str:
    """Title, rule, parameters, rule."""
    line = " ".join(legal(title).split())
    return f"{'' if line == '--' else line}\n--\n{parameters(values)}\n--\nhalign=left"


def _head(machine: MachineDefinition) -> str:
    said = {name: getattr(machine, name) for name in ("name", "description") if getattr(machine, name)}
    return "".join(f"// {json_text(json.dumps({k: v}, ensure_ascii=False)[1:-1])}\n" for k, v in said.items())


def _state_text(machine: MachineDefinition, index: int) -> str:
    state = machine.states[index]
    return state_text(state.label or str(state.id), state_json(state))


def _transition_text(transition: TransitionSpec, order: int | None) -> str:
    when = transition.when
    ends = {"from": transition.source, "to": transition.target}
    place = {} if order is None else {"order": order}
    return "lt=->\n" + parameters({"id": transition.id, "type": when.type, **ends, **place, **members(when)})


def _size(text: str) -> tuple[float, float]:
    """Width and height of a state that shows a text, px, in steps of 10."""
    lines = text.split("\n")[:-1]
    width = max(len(line) for line in lines) * _LETTER + 20
    height = len(lines) * _LINE + 10
    return max(100.0, min(width, 600.0)) // 10 * 10, height // 10 * 10 + 10
