"""Machine files that are shipped: each machine also as a diagram, and the palette to draw machines with."""

from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import pytest

import tral_fsm
from tral_fsm import load_machine, machine_names
from tral_fsm.definition.conditions import CONDITIONS
from tral_fsm.definition.machine import STATES, TransitionSpec
from tral_fsm.draw.layered.shapes import Rect
from tral_fsm.formats import members, read
from tral_fsm.formats.umlet import palette, writer
from tral_fsm.formats.umlet.elements import sections
from tral_fsm.formats.xml_tree import Node, parse

PACKAGE = Path(tral_fsm.__file__).parent
FOLDER = PACKAGE / "machines"
PALETTE = PACKAGE / palette.FILE


@pytest.mark.parametrize("name", machine_names())
def test_each_machine_is_also_a_diagram(name: str) -> None:
    path = FOLDER / f"{name}.uxf"
    command = f"tral fsm convert {path.with_suffix('.json')} {path}"
    assert path.exists(), f"{path} is missing: {command}"
    assert load_machine(path) == load_machine(name), f"{path} is out of step: {command}"


def test_each_diagram_is_also_a_machine() -> None:
    assert sorted(path.stem for path in FOLDER.glob("*.uxf")) == machine_names()


def sides(node: Node) -> list[float]:
    """x, y, width, height of an element."""
    (place,) = node.all("coordinates")
    return [float(place.child_text(side)) for side in "xywh"]


def arrow_points(node: Node) -> list[tuple[float, float]]:
    x, y, *_ = sides(node)
    numbers = [float(number) for number in node.child_text("additional_attributes").split(";")]
    return [(x + a, y + b) for a, b in zip(numbers[::2], numbers[1::2], strict=True)]


def label_room(node: Node) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of an arrow's text: UMLet centres its lines of 18 px on the arrow's middle line."""
    lines = node.child_text("panel_attributes").split("\n")[1:]
    pieces = list(pairwise(arrow_points(node)))
    (x0, y0), (x1, y1) = pieces[len(pieces) // 2]
    filled = [index for index, line in enumerate(lines) if line.strip()]
    top = (y0 + y1) / 2 - 18 * len(lines) / 2
    half = 7.5 * max(map(len, lines)) / 2
    middle = (x0 + x1) / 2
    return middle - half, top + 18 * filled[0] + 2, middle + half, top + 18 * (filled[-1] + 1) - 2


def meet(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@pytest.mark.parametrize("name", machine_names())
def test_no_label_of_a_diagram_lies_over_another_under_an_arrow_or_over_a_state(name: str) -> None:
    nodes = list(parse((FOLDER / f"{name}.uxf").read_text("utf-8")).all("element"))
    arrows = [node for node in nodes if node.child_text("id") == "Relation"]
    labels = [label_room(node) for node in arrows if "type" in node.child_text("panel_attributes")]
    lines = [
        (min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1]))
        for node in arrows
        for a, b in pairwise(arrow_points(node))
    ]
    states = [(x, y, x + w, y + h) for x, y, w, h in map(sides, (node for node in nodes if node not in arrows))]
    assert len(labels) == len(load_machine(name).transitions)
    assert not [pair for pair in combinations(labels, 2) if meet(*pair)]
    assert not [(label, other) for label in labels for other in [*lines, *states] if meet(label, other)]


def test_the_palette_is_in_step_with_the_definition() -> None:
    write = f"python -c \"from tral_fsm.formats.umlet import palette as p; print(p.dumps(), end='')\" > {PALETTE}"
    assert PALETTE.read_text("utf-8") == palette.dumps(), f"out of step: {write}"


def elements(kind: str) -> list[Node]:
    root = parse(PALETTE.read_text("utf-8"))
    return [node for node in root.all("element") if node.child_text("id") == kind]


def values(text: str) -> dict[str, Any]:
    faults: list[str] = []
    found = members.parse("\n".join(line for line in text.split("\n") if not line.startswith("//")), faults.append)
    assert not faults
    return found


def plain_values(found: dict[str, Any]) -> dict[str, Any]:
    """Without what only a whole machine can check."""
    return {key: value for key, value in found.items() if key not in ("id", "of")}


@pytest.mark.parametrize("name", STATES)
def test_the_palette_has_every_state_with_every_parameter(name: str) -> None:
    (found,) = [
        v for n in elements("UMLState") if (v := values(sections(n.child_text("panel_attributes"))[1]))["type"] == name
    ]
    spec = STATES[name]
    assert set(found) == set(spec.model_fields) - set(spec.exactly_one[1:])
    made = spec(**found)
    for key, field in spec.model_fields.items():
        if key not in ("id", *spec.exactly_one, *palette.EXAMPLES.get(name, ())) and not field.is_required():
            assert getattr(made, key) == field.default


@pytest.mark.parametrize("name", CONDITIONS)
def test_the_palette_has_every_transition_with_every_parameter(name: str) -> None:
    texts = [node.child_text("panel_attributes").removeprefix("lt=->\n") for node in elements("Relation")]
    (found,) = [v for text in texts if (v := values(text))["type"] == name]
    spec = CONDITIONS[name]
    assert set(found) - {"id"} == set(spec.model_fields) - set(spec.exactly_one[1:])
    inner = {"of": tuple(CONDITIONS[part.pop("type")](**part) for part in found["of"])} if "of" in found else {}
    made = spec(**plain_values(found), **inner)
    assert TransitionSpec(id=found["id"], source=0, target=1, when=made).when == made


def test_a_machine_may_be_drawn_from_the_palette_as_it_is() -> None:
    """Motor, Finished, Motor, Finished, each dragged and nothing edited."""

    def text(kind: str, name: str) -> str:
        texts = [node.child_text("panel_attributes") for node in elements(kind)]
        return next(found for found in texts if f'"type": "{name}"' in found)

    root = writer.element("UMLSpecialState", Rect(0, 40, 20, 20), "type=initial")
    states = [writer.element("UMLState", Rect(x, 0, 200, 100), text("UMLState", "Motor")) for x in (100, 500)]
    finished = text("Relation", "Finished")
    arrows = [
        writer.relation("lt=->", [(20, 50), (100, 50)]),
        writer.relation(finished, [(300, 30), (500, 30)]),
        writer.relation(finished, [(500, 70), (300, 70)]),
    ]
    machine = read(writer.diagram([root, *states, *arrows]), "drawn.uxf")
    assert [(way.id, way.source, way.target) for way in machine.transitions] == [
        ("Finished", "Motor", "Motor 2"),
        (0, "Motor 2", "Motor"),
    ]


def test_the_palette_has_both_nodes() -> None:
    assert [node.child_text("panel_attributes") for node in elements("UMLSpecialState")] == [
        "type=initial",
        "type=final",
    ]
