"""UMLet files (.uxf), read and written."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.formats.plain import Plain, Problems
from tral_fsm.formats.umlet import writer as uxf_writer
from tral_fsm.formats.umlet.elements import FULL_ZOOM, Diagram, Element
from tral_fsm.formats.umlet.elements import plain as understand
from tral_fsm.formats.xml_tree import Node

_MAX_POINTS_TEXT = 10_000
"""Longest text of an arrow's points; a longer one is not read. Source: choice."""
_ONCE = ("zoom_level", "help_text", "id", "type", "coordinates", "panel_attributes", "additional_attributes")
"""Tags that stand once in a diagram or an element."""
ROOTS = ("diagram", "umlet_diagram")
"""Tags of a whole file, new and legacy."""


def plain(root: Node, problems: Problems) -> Plain:
    """The machine that a UMLet file shows.

    Args:
        root: the file.
        problems: takes the problems of the file.
    """
    zoom = number(root.child_text("zoom_level") or "10")
    if zoom is None or zoom <= 0.0:
        problems.complain("", f"got zoom_level {root.child_text('zoom_level')[:30]!r}, expected a number above 0")
        zoom = FULL_ZOOM
    nodes = list(_elements(root))
    for index, node in enumerate((root, *nodes)):
        for tag in _ONCE:
            if sum(1 for _ in node.all(tag)) > 1:
                problems.complain("", f"got <{tag}> twice", f"element {index}" if index else "diagram")
    elements = [_element(node) for node in nodes]
    return understand(Diagram(elements, zoom, root.child_text("help_text")), problems)


def dumps(machine: MachineDefinition) -> str:
    """Write a machine as a UMLet file."""
    return uxf_writer.dumps(machine)


def _elements(node: Node) -> Iterator[Node]:
    """All elements, also those of groups."""
    for child in node.children:
        if child.tag == "element":
            yield child
        elif child.tag == "group":
            yield from _elements(child)


def _element(node: Node) -> Element:
    legacy = next(node.all("id"), None) is None
    kind = node.child_text("type" if legacy else "id").strip().rpartition(".")[2]
    coordinates = next(node.all("coordinates"), Node("", {}, 0))
    sides = [number(coordinates.child_text(side)) for side in "xywh"]
    return element(kind, legacy, sides, node.child_text("panel_attributes"), node.child_text("additional_attributes"))


def element(kind: str, legacy: bool, sides: list[float | None], text: str, points: str) -> Element:
    """An element from its parts: x, y, width, height as numbers, points as text `x;y;x;y`."""
    x, y, width, height = sides
    known = x is not None and y is not None and width is not None and height is not None
    known_points = kind == "Relation" and len(points) < _MAX_POINTS_TEXT
    values = [number(part) for part in points.split(";")] if known_points else []
    pairs = tuple((a, b) for a, b in zip(values[::2], values[1::2], strict=False) if a is not None and b is not None)
    whole = len(pairs) * 2 == len(values) and len(pairs) > 1
    box = (x, y, width, height) if known else None
    return Element(kind, text, box, pairs if whole else (), legacy)  # type: ignore[arg-type]


def number(text: object) -> float | None:
    """Number of a text of at most nine digits before the point; None for other text."""
    found = re.fullmatch(r"\s*(-?\d{1,9}(?:\.\d{0,20})?)\s*", str(text), re.ASCII)
    return float(found[1]) if found and math.isfinite(float(found[1])) else None
