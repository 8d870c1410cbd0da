"""UMLet files converted by `xml2json`: one element is an object, several are an array, an empty tag is null."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tral_fsm.formats.plain import Plain, Problems
from tral_fsm.formats.umlet.elements import FULL_ZOOM, Diagram, Element
from tral_fsm.formats.umlet.elements import plain as understand
from tral_fsm.formats.umlet.uxf import ROOTS, element, number

MAX_DEPTH = 20
"""Deepest nesting of groups. Source: choice; UMLet's own files have one or two."""


def is_one(value: Any) -> bool:
    """Whether plain JSON values come from a UMLet file."""
    return isinstance(value, dict) and any(root in value for root in ROOTS)


def plain(value: Any, problems: Problems) -> Plain:
    """The machine that a UMLet file in its JSON form shows.

    Args:
        value: plain JSON values for which `is_one` holds.
        problems: takes the problems of the file.
    """
    name = next(name for name in ROOTS if name in value)
    root = value[name]
    for other in value.keys() - {name}:
        problems.complain("", f"got {other[:60]!r} beside {name!r}, expected one diagram")
    if not isinstance(root, dict):
        if root is not None:
            problems.complain("/diagram", f"got {type(root).__name__}, expected an object")
        root = {}
    zoom = number(_text(root.get("zoom_level")) or "10")
    if zoom is None or zoom <= 0.0:
        problems.complain("/diagram/zoom_level", "expected a number above 0")
        zoom = FULL_ZOOM
    elements = [_element(item) for item in _elements(root, problems)]
    return understand(Diagram(elements, zoom, _text(root.get("help_text"))), problems)


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [] if value is None else [value]


def _elements(root: dict[str, Any], problems: Problems, depth: int = 0) -> Iterator[dict[str, Any]]:
    """All elements, also those of groups."""
    for item in _list(root.get("element")):
        if isinstance(item, dict):
            yield item
        else:
            problems.complain("/diagram/element", f"got {type(item).__name__}, expected an object")
    for group in _list(root.get("group")):
        if group is None:
            continue  # an empty group among others
        if not isinstance(group, dict):
            problems.complain("", f"got {type(group).__name__} as a group, expected an object", "diagram")
        elif depth >= MAX_DEPTH:
            problems.complain("", f"groups nested more than {MAX_DEPTH} deep", "diagram")
        else:
            yield from _elements(group, problems, depth + 1)


def _text(value: Any) -> str:
    """Text of a tag: a value, "#text" beside attributes, or pieces around comments; empty for null."""
    if isinstance(value, dict):
        return _text(value.get("#text"))
    if isinstance(value, list):
        return "".join(part for part in value if isinstance(part, str))
    return str(value) if isinstance(value, str | int | float) else ""


def _element(item: dict[str, Any]) -> Element:
    legacy = "id" not in item
    kind = _text(item.get("type" if legacy else "id")).strip().rpartition(".")[2]
    coordinates = item.get("coordinates")
    where = coordinates if isinstance(coordinates, dict) else {}
    sides = [number(_text(where.get(side))) for side in "xywh"]
    texts = (_text(item.get("panel_attributes")), _text(item.get("additional_attributes")))
    return element(kind, legacy, sides, *texts)
