"""A picture of a machine as SVG text, without references to anything outside."""

from __future__ import annotations

from collections.abc import Iterable
from urllib.parse import quote
from xml.etree import ElementTree as ET

from tral_fsm.draw.picture import INK, Dot, Line, Mark, Outline, Picture, arrow_head
from tral_fsm.draw.text import SIZE

_FONTS = "DejaVu Sans, Verdana, Arial, Helvetica, sans-serif"


def svg(picture: Picture) -> str:
    """The picture as the text of an SVG file."""
    root = ET.Element(
        "svg",
        {
            "xmlns": "http://www.w3.org/2000/svg",
            "width": str(picture.width),
            "height": str(picture.height),
            "viewBox": f"0 0 {picture.width} {picture.height}",
            "font-family": _FONTS,
            "font-size": str(SIZE),
        },
    )
    ET.SubElement(root, "title").text = picture.title
    _add(root, "rect", width="100%", height="100%", fill="white")
    for mark in picture.marks:
        _draw(root, mark)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=False) + "\n"


def _add(parent: ET.Element, tag: str, title: str = "", **attributes: object) -> ET.Element:
    element = ET.SubElement(parent, tag, {name.replace("_", "-"): str(value) for name, value in attributes.items()})
    if title:
        ET.SubElement(element, "title").text = title
    return element


def _draw(root: ET.Element, mark: Mark) -> None:
    if isinstance(mark, Line):
        points = _points(mark.points)
        # The white line below tells crossings from turns.
        _add(root, "polyline", points=points, fill="none", stroke="white", stroke_width=4)
        named = {"data_transitions": " ".join(map(_word, mark.names))} if mark.names else {}
        _add(root, "polyline", mark.title, points=points, fill="none", stroke=mark.colour, stroke_width=1.2, **named)
        _add(root, "polygon", points=_points(arrow_head(mark)), fill=mark.colour)
    elif isinstance(mark, Outline):
        named = {"data_state": _word(mark.name)} if mark.name else {}
        _add(
            root, "rect", mark.title, x=mark.x, y=mark.y, width=mark.w, height=mark.h, rx=6, fill=mark.fill,
            stroke=mark.colour, stroke_width=1.8 if mark.strong else 1.0, **named,
        )  # fmt: skip
    elif isinstance(mark, Dot):
        _add(root, "circle", cx=mark.centre[0], cy=mark.centre[1], r=mark.radius, fill=INK)
    else:
        x, y = mark.at
        style = {"font_weight": "bold"} if mark.bold else {}
        _add(root, "text", x=x, y=y, fill=mark.colour, text_anchor=mark.align.replace("left", "start"), **style)
        root[-1].text = mark.text


def _word(name: str) -> str:
    """A name without spaces, so that a list of names can hold it."""
    return quote(name, safe=":")


def lit(states: Iterable[str] = (), transitions: Iterable[str] = ()) -> str:
    """Style sheet that lights states and transitions of a picture in a page that holds its SVG.

    Args:
        states: names, see `panels.marks_of_states`.
        transitions: names, see `panels.marks_of_transitions`.
    """
    rules = [f'rect[data-state="{_word(name)}"]{{fill:#ffd84d;stroke-width:3}}' for name in states]
    rules += [f'polyline[data-transitions~="{_word(name)}"]{{stroke-width:4}}' for name in transitions]
    return "\n".join(rules)


def _points(points: tuple[tuple[int, int], ...]) -> str:
    return " ".join(f"{x},{y}" for x, y in points)
