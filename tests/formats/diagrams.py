"""UMLet diagrams by hand: a machine of two states, element by element."""

import json
from typing import Any

import pytest

from tral_fsm import FormatError, MachineDefinition
from tral_fsm.formats import read

STATES = {"go": (0, 0, 100, 60), "rest": (300, 0, 100, 60)}
"""Title -> x, y, width, height."""
TEXTS = {"go": '"id": 0,\n"type": "Motor",\n"throttle": 0.2', "rest": '"id": 1,\n"type": "Stop"'}
ACROSS = "10;10;210;10"
"""Points of an arrow at x = 90, y = 20: from the right side of `go` to the left side of `rest`."""


def tag(name: str, content: object) -> str:
    text = str(content).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return f"<{name}>{text}</{name}>"


def element(kind: str, box: tuple[float, ...], text: str = "", points: str = "", legacy: bool = False) -> str:
    sides = "".join(tag(side, length) for side, length in zip("xywh", box, strict=True))
    name = tag("type", f"com.umlet.element.{kind}") if legacy else tag("id", kind)
    return (
        f"<element>{name}<coordinates>{sides}</coordinates>{tag('panel_attributes', text)}"
        f"{tag('additional_attributes', points)}</element>"
    )


def state(title: str, text: str | None = None) -> str:
    return element("UMLState", STATES[title], f"{title}\n--\n{text or TEXTS[title]}\n--\nbg=red")


def arrow(text: str, points: str = ACROSS, box: tuple[float, ...] = (90, 20, 220, 20)) -> str:
    return element("Relation", box, text, points)


ROOT = element("UMLSpecialState", (-60, 20, 20, 20), "type=initial") + arrow("lt=->", "10;10;50;10", (-50, 20, 60, 20))
ALWAYS = "lt=->\nid: 0\ntype: Always\n"
TWO = state("go") + state("rest")


def diagram(*elements: str, zoom: object = 10, text: str = "") -> str:
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><diagram program="umlet" version="15.1">{tag("help_text", text)}'
        f"{tag('zoom_level', zoom)}{''.join(elements)}</diagram>"
    )


EXPECTED: dict[str, Any] = {
    "root": 0,
    "states": [{"id": 0, "type": "Motor", "throttle": 0.2}, {"id": 1, "type": "Stop"}],
    "transitions": [{"id": 0, "type": "Always", "from": 0, "to": 1}],
}


def expected(**changes: Any) -> MachineDefinition:
    return read(json.dumps({**EXPECTED, **changes}), "expected.json")


def problems(text: str) -> list[str]:
    with pytest.raises(FormatError) as caught:
        read(text, "my.uxf", ".uxf")
    assert str(caught.value).startswith("my.uxf: ")
    return [str(problem) for problem in caught.value.problems]
