"""Errors of pydantic in the words of a file: their place, and what is allowed there.

They are told from the kind of an error, its limits and the annotations of the model, so that no release of pydantic
that words or names things otherwise changes a message.
"""

from __future__ import annotations

import types
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

WORDS: Mapping[str, str] = {
    "greater_than": "more than {gt:g}",
    "greater_than_equal": "{ge:g} or more",
    "less_than": "less than {lt:g}",
    "less_than_equal": "{le:g} or less",
    "too_short": "{min_length} or more",
    "too_long": "{max_length} or less",
    "string_too_short": "a text of {min_length} or more characters",
    "string_too_long": "a text of {max_length} or fewer characters",
    "string_pattern_mismatch": "a text that matches {pattern}",
    "multiple_of": "a multiple of {multiple_of:g}",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "a text",
    "tuple_type": "an array",
    "list_type": "an array",
    "model_type": "an object",
    "dict_type": "an object",
}
"""Kind of an error -> what is allowed."""

_NAMES = {int: "a whole number", float: "a number", str: "a word", bool: "true or false"}
"""Type in a union -> its words."""


class Place(NamedTuple):
    """Where a value is, and what the model says of it."""

    steps: tuple[int | str, ...]
    """Members and indices from the model to the value, without the types of a union that pydantic tried."""
    annotation: Any
    """Type of the value; None: the model does not know the member."""
    owner: Any
    """Type of what holds the value."""


def place(model: Any, error: Mapping[str, Any]) -> Place:
    """The place of an error.

    Args:
        model: class that was validated.
        error: one of `ValidationError.errors()`.
    """
    steps: list[int | str] = []
    annotation, owner = model, model
    for number, step in enumerate(error["loc"]):
        found = _inside(annotation, step)
        if found is not None:
            annotation, owner = found, annotation
        elif error["type"] == "extra_forbidden" and number == len(error["loc"]) - 1:
            annotation, owner = None, annotation
        else:
            continue
        steps.append(step)
    return Place(tuple(steps), annotation, owner)


def _inside(annotation: Any, step: int | str) -> Any:
    """Type of a member or an item; None: there is none."""
    for kind in members(annotation):
        if isinstance(step, str) and hasattr(kind, "model_fields"):
            for name, field in kind.model_fields.items():
                if step in (name, field.alias):
                    return field.annotation
        arguments = get_args(kind)
        if arguments and isinstance(step, int) and get_origin(kind) in (tuple, list):
            return arguments[0] if arguments[-1] is Ellipsis else arguments[min(step, len(arguments) - 1)]
        if arguments and get_origin(kind) in (dict, Mapping):
            return arguments[-1]
    return None


def members(annotation: Any) -> tuple[Any, ...]:
    """Types that an annotation allows: those of a union, else the one that it is; None is left out."""
    if get_origin(annotation) is Annotated:
        return members(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        return tuple(kind for part in get_args(annotation) for kind in members(part))
    return () if annotation in (None, type(None)) else (annotation,)


def choices(annotation: Any) -> list[Any]:
    """Values that the literals of an annotation list."""
    return [value for kind in members(annotation) if get_origin(kind) is Literal for value in get_args(kind)]


def names(annotation: Any) -> list[str]:
    """Names of the members that a model may have, as a file spells them."""
    return [
        field.alias or name for kind in members(annotation) for name, field in getattr(kind, "model_fields", {}).items()
    ]


def allowed(annotation: Any, error: Mapping[str, Any], words: Mapping[str, str] = WORDS) -> str:
    """What is allowed instead of the value of an error.

    Args:
        annotation: type of the value.
        error: one of `ValidationError.errors()`.
        words: kind of an error -> what is allowed, with the names of its limits in braces.
    """
    kinds = members(annotation)
    if len(kinds) > 1:
        return " or ".join(_NAMES.get(kind, getattr(kind, "__name__", str(kind))) for kind in kinds)
    told = words.get(error["type"], f"another value ({error['type'].replace('_', ' ')})")
    return told.format(**error.get("ctx", {}))
