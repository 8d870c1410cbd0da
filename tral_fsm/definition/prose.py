"""Conditions in words: how they are combined, and the parameters that matter.

There are two wordings of a condition that combines no others: `parameters` is short, for pictures ("front < 0.5 m");
`in_full` names every value as a machine file does ("sensor front below 0.5 m").
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.validated import Spec, null_of, unit_of

_NO_PARAMETER = ("type", "id", "label", "final", "machine")
_SIGNS = (("above", ">"), ("below", "<"), ("max", "≤"))
"""Part of a parameter's name -> the sign that says it in the short wording."""


def combined(condition: ConditionSpec, wording: Callable[[ConditionSpec], str], inside: bool = False) -> str:
    """A condition in words: "(A or B) and not C".

    Args:
        condition: what is put into words.
        wording: gives the words of a condition that combines no others.
        inside: the words stand among others, so that several parts need parentheses.
    """
    if not condition.parts:
        return wording(condition)
    parts = [combined(part, wording, inside=True) for part in condition.parts]
    if condition.joined is None:
        return f"{condition.type}({', '.join(parts)})"
    before, between = condition.joined
    text = before + between.join(parts)
    return f"({text})" if inside and len(parts) > 1 else text


def in_full(condition: ConditionSpec) -> str:
    """The long wording: the type, and each parameter that differs from its default with name, value and unit."""
    spec = type(condition)
    told = [condition.type]
    for name, field in spec.model_fields.items():
        value = getattr(condition, name)
        if name == "sensor" or (name != "type" and (field.is_required() or value != field.default)):
            text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=_as_json)
            unit = "" if value is None else unit_of(spec, name)
            told.append(" ".join(part for part in (name.removesuffix("_deg"), text, unit) if part))
    return " ".join(told)


def parameters(part: Spec, always: bool) -> Iterator[str]:
    """The short wording, a text for each parameter that differs from its default.

    Args:
        part: a condition or a state.
        always: a parameter that is a word is given even if it is the default. The name of such a parameter, and of an
            only one, is left out, since the value says enough.
    """
    fields = {name: field for name, field in type(part).model_fields.items() if name not in _NO_PARAMETER}
    for name, field in fields.items():
        value = getattr(part, name)
        if value == field.default and not (always and isinstance(value, str)):
            continue
        alone = always and value is not None and (isinstance(value, str) or len(fields) == 1)
        word = null_of(type(part), name)
        if value is None and word:
            yield f"{_spaced(name)} {word}"
            continue
        yield _parameter("" if alone else name, value, unit_of(type(part), name))


def _parameter(name: str, value: object, unit: str) -> str:
    if value is None:
        return f"no {_spaced(name)}"
    if isinstance(value, bool):
        return _spaced(name) if value else f"not {_spaced(name)}"
    shown = f"{value:.6g}" if isinstance(value, float) else str(value)
    if isinstance(value, tuple):
        shown = ", ".join(str(part) for part in value)
    shown += {"": "", "deg": "°"}.get(unit, f" {unit}")
    for word, sign in _SIGNS:
        if word in name.split("_"):
            return f"{_spaced(name.replace(word, ''))} {sign} {shown}".strip()
    return f"{_spaced(name)} {shown}".strip()


def _spaced(name: str) -> str:
    return name.removesuffix("_deg").replace("_", " ").strip()


def _as_json(part: Any) -> Any:
    """A part of a machine within a parameter, as it stands in a file."""
    return {"type": part.type, **part.model_dump(mode="json", exclude_defaults=True)}
