"""The palette of UMLet: all states and transitions with their parameters, to drag into a diagram."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from tral_fsm.conditions import CONDITIONS
from tral_fsm.definition.validated import Spec, type_name
from tral_fsm.draw.layered.shapes import Rect
from tral_fsm.formats.umlet.writer import diagram, element, relation, size
from tral_fsm.states import STATES

FILE = "machines/palette/TRAL_State-Machine.uxf"
"""File of the palette within the package."""

_REQUIRED: dict[str, Any] = {"of": [{"type": "Timer", "seconds": 1.0}], "machine": "wall", "throttle": -0.3}
"""Examples for parameters that have no default and do not allow 1."""
EXAMPLES: dict[str, dict[str, Any]] = {"Motor": {"distance": 1.0}}
"""Type -> parameters that are no defaults: with a distance a Motor finishes, as a transition Finished asks."""
_COLUMNS, _GAP, _ARROW = 2, 30, 60
_WIDTH = 320


def dumps() -> str:
    """The palette as a UMLet file: states in columns on the left, transitions in columns beside them."""
    found = []
    for first, (texts, make) in enumerate(((_texts(STATES, "state"), _state), (_texts(CONDITIONS, "arrow"), _arrow))):
        below = [0] * _COLUMNS
        for text in texts:
            column = below.index(min(below))
            height = size(text)[1]
            found.append(make(_GAP + (first * _COLUMNS + column) * (_WIDTH + _GAP), _GAP + below[column], height, text))
            below[column] += height + _GAP
    start = Rect(_GAP + 2 * _COLUMNS * (_WIDTH + _GAP), _GAP, 20, 20)
    found.append(element("UMLSpecialState", start, "type=initial"))
    found.append(element("UMLSpecialState", Rect(start.x + 40, start.y, 20, 20), "type=final"))
    return diagram(found)


def _texts(specs: Mapping[str, type[Spec]], kind: str) -> list[str]:
    if kind == "state":
        return [f"{name}\n--\n{_parameters(spec)}\n--\nhalign=left" for name, spec in specs.items()]
    return [f"lt=->\n{text}{_below(text)}" for text in map(_parameters, specs.values())]


def _below(text: str) -> str:
    """Empty lines that push an arrow's text above it."""
    return "\n" * (1 + sum(not line.startswith("//") for line in text.split("\n")))


def _state(x: int, y: int, height: int, text: str) -> str:
    return element("UMLState", Rect(x, y, _WIDTH, height), text)


def _arrow(x: int, y: int, height: int, text: str) -> str:
    return relation(text, [(x, y + height / 2), (x + _WIDTH, y + height / 2)])


def _parameters(spec: type[Spec]) -> str:
    """Members with their defaults, each below a comment, which UMLet does not draw."""
    name = type_name(spec)
    lines = [f'"id": {json.dumps(name)},', f'"type": {json.dumps(name)}']
    example = EXAMPLES.get(name, {})
    without = {"id", "type", *spec.exactly_one[1:]}
    for key, field in spec.model_fields.items():
        if key in without:
            continue
        lines[-1] = lines[-1].rstrip(",") + ","
        lines += [
            f"// {_comment(field)}",
            f"{json.dumps(key)}: {json.dumps(example.get(key, _value(key, field, key in spec.exactly_one)))}",
        ]
    return "\n".join(lines)


def _comment(field: FieldInfo) -> str:
    extra = field.json_schema_extra
    unit = extra.get("unit") if isinstance(extra, dict) else None
    choices = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
    allowed = f" ({', '.join(map(str, choices))})" if choices else ""
    return f"{field.description}{allowed}{f' [{unit}]' if unit else ''}"


def _value(key: str, field: FieldInfo, must: bool) -> Any:
    """The default of a parameter, or an example if it has none."""
    if key in _REQUIRED:
        return _REQUIRED[key]
    if field.is_required() or (must and field.default is None):
        return 0.5 if must else 1.0
    return list(field.default) if isinstance(field.default, tuple) else field.default
