"""Machines as SVG and PNG."""

import io
from dataclasses import replace
from itertools import combinations
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from PIL import Image

from tral_env.errors import MachineError
from tral_fsm import load_machine, machine_names
from tral_fsm.conditions.simple import TimerSpec
from tral_fsm.definition.machine import MachineDefinition, TransitionSpec
from tral_fsm.draw import text
from tral_fsm.draw.layered.shapes import Rect
from tral_fsm.draw.panels import TONES, state_tones
from tral_fsm.draw.picture import Line, Outline, Picture, Words, arrow_head, picture
from tral_fsm.draw.png import png
from tral_fsm.draw.svg import svg
from tral_fsm.states.basic import IdleSpec, StopSpec
from tral_fsm.states.fsm_state import FSMStateSpec

NS = "{http://www.w3.org/2000/svg}"
INNER = MachineDefinition(root=0, name="inner", states=(StopSpec(id=0, label="halt"),))


def holding(*machines: MachineDefinition | str) -> MachineDefinition:
    """A machine of inner machines, one after the other."""
    states = tuple(FSMStateSpec(id=i, machine=machine) for i, machine in enumerate(machines))
    ways = tuple(
        TransitionSpec(id=i, source=i, target=i + 1, when=TimerSpec(seconds=1.0)) for i in range(len(machines) - 1)
    )
    return MachineDefinition(root=0, name="outer", states=states, transitions=ways)


def words(drawn: Picture) -> list[str]:
    return [mark.text for mark in drawn.marks if isinstance(mark, Words)]


def room(mark: Words) -> Rect:
    width = text.width(mark.text, mark.bold)
    return Rect(
        mark.at[0] - (width // 2 if mark.align == "middle" else 0), mark.at[1] - text.SIZE, width, text.SIZE + 2
    )


def pictured(machine: MachineDefinition) -> Picture:
    """With the packaged machines that it names."""
    return picture(machine, load_machine)


@pytest.mark.parametrize("name", machine_names())
def test_no_words_are_on_top_of_others_or_off_the_page(name: str) -> None:
    drawn = pictured(load_machine(name))
    rooms = [room(mark) for mark in drawn.marks if isinstance(mark, Words)]
    assert not [(a, b) for a, b in combinations(rooms, 2) if a.overlaps(b)]
    assert all(r.x >= 0 and r.x + r.w <= drawn.width and r.y >= 0 and r.y + r.h <= drawn.height for r in rooms)


def test_every_state_and_transition_is_in_the_picture() -> None:
    machine = load_machine("gate")
    drawn = pictured(machine)
    assert {str(state.id) for state in machine.states} <= set(words(drawn))
    titles = " ".join(mark.title for mark in drawn.marks if isinstance(mark, Line))
    assert all(str(transition.id) in titles for transition in machine.transitions)


def test_transitions_of_a_state_are_numbered_as_they_are_asked() -> None:
    states = (IdleSpec(id=0), StopSpec(id=1))
    ways = tuple(TransitionSpec(id=i, source=0, target=1, when=TimerSpec(seconds=1.0 + i)) for i in range(2))
    drawn = pictured(MachineDefinition(root=0, states=states, transitions=ways))
    assert [word for word in words(drawn) if "Timer" in word] == ["1. Timer 1 s", "2. Timer 2 s"]


def test_an_end_has_two_outlines_and_the_root_a_strong_one() -> None:
    states = (IdleSpec(id=0), StopSpec(id=1))
    way = TransitionSpec(id=0, source=0, target=1, when=TimerSpec(seconds=1.0))
    drawn = pictured(MachineDefinition(root=0, states=states, transitions=(way,)))
    assert [mark.strong for mark in drawn.marks if isinstance(mark, Outline)] == [True, False, False]


def test_inner_machines_stand_below_each_packaged_one_once() -> None:
    drawn = pictured(holding("gate", INNER, "gate"))
    headings = [mark.text for mark in drawn.marks if isinstance(mark, Words) and mark.at[0] == 20]
    assert headings == ["outer", "gate", "inner, in state 1"]
    assert "0: halt" in words(drawn)


def test_an_inner_machine_that_two_states_share_is_drawn_once() -> None:
    drawn = pictured(holding(INNER, INNER))
    headings = [mark.text for mark in drawn.marks if isinstance(mark, Words) and mark.at[0] == 20]
    assert headings == ["outer", "inner, in state 0"]


def test_machines_are_looked_up_as_the_caller_says() -> None:
    drawn = picture(holding("mine"), resolve={"mine": INNER}.__getitem__)
    assert "0: halt" in words(drawn)


def test_a_name_that_nobody_resolves_is_an_error_that_tells_the_remedy() -> None:
    with pytest.raises(MachineError, match=r"state 0 names the machine 'gate'.*resolve=tral_fsm\.load_machine"):
        picture(holding("gate"))


@pytest.mark.parametrize(("points", "tip"), [(((0, 0), (50, 0)), (41, 4)), (((0, 50), (0, 0)), (-4, 9))])
def test_heads_point_where_the_arrow_leads(points: tuple, tip: tuple) -> None:
    head = arrow_head(Line(points, "black"))
    assert head[0] == points[-1]
    assert tip in head


def test_the_svg_refers_to_nothing_outside() -> None:
    written = svg(pictured(load_machine("office")))
    root = ET.fromstring(written)
    assert root.tag == f"{NS}svg"
    assert not [name for element in root.iter() for name in element.attrib if "href" in name or name == "src"]
    assert "url(" not in written
    assert written.count("http") == 1
    assert {element.tag.removeprefix(NS) for element in root} == {
        "title", "rect", "polyline", "polygon", "circle", "text",
    }  # fmt: skip


def test_names_that_look_like_markup_stay_names() -> None:
    machine = MachineDefinition(root="<a&b>\x00\x1b", name='"<x>', states=(StopSpec(id="<a&b>\x00\x1b"),))
    root = ET.fromstring(svg(pictured(machine)))
    assert "<a&b>��" in [element.text for element in root.iter(f"{NS}text")]


def test_the_same_machine_gives_the_same_bytes() -> None:
    gate = load_machine("gate")
    assert svg(pictured(gate)) == svg(pictured(gate))
    assert png(pictured(gate)) == png(pictured(gate))


def test_the_png_has_the_size_of_the_picture_times_the_scale() -> None:
    drawn = pictured(load_machine("gate"))
    image = Image.open(io.BytesIO(png(drawn, scale=2.0)))
    assert image.size == (2 * drawn.width, 2 * drawn.height)


def test_an_arrow_is_drawn_in_its_colour_where_it_stands() -> None:
    drawn = pictured(load_machine("gate"))
    line = next(mark for mark in drawn.marks if isinstance(mark, Line) and mark.title.startswith("gate seen"))
    (x0, y0), (x1, y1) = line.points[:2]
    image = Image.open(io.BytesIO(png(replace(drawn), scale=2.0))).convert("RGB")
    r, g, b = image.getpixel((x0 + x1, y0 + y1))
    assert b > 140
    assert r < 110
    assert g < 150


def test_letters_that_the_font_lacks_are_no_error() -> None:
    assert png(pictured(MachineDefinition(root="廊下 $x$", states=(StopSpec(id="廊下 $x$"),)))).startswith(b"\x89PNG")


def test_a_huge_picture_becomes_an_image_that_can_be_opened() -> None:
    image = Image.open(io.BytesIO(png(Picture(60000, 100, (Words((10, 50), "far"),), "long"))))
    assert image.size == (12000, 20)


def test_a_state_has_the_colour_in_its_picture_that_it_has_in_a_drive() -> None:
    machine = holding(INNER, "gate")
    outlines = [mark.colour for mark in pictured(machine).marks if isinstance(mark, Outline) and mark.fill != "none"]
    tones = state_tones(machine, load_machine)
    assert list(tones)[:2] == ["0/halt", "1/follow"]
    # Two states of the outer machine come first, then the inner machines.
    assert outlines == [*TONES[:2], *tones.values()]


def test_colours_of_states_differ_and_are_readable_on_white() -> None:
    assert len(set(TONES)) == len(TONES)
    for tone in TONES:
        linear = [
            (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4)
            for c in np.frombuffer(bytes.fromhex(tone[1:]), np.uint8) / 255
        ]
        assert 1.05 / (np.dot([0.2126, 0.7152, 0.0722], linear) + 0.05) > 4.5
