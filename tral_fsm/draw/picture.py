"""A machine as lines, boxes and words, the same for all kinds of pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.draw import text
from tral_fsm.draw.layered.content import ordinals
from tral_fsm.draw.layered.shapes import Arrangement, Direction, Point
from tral_fsm.draw.layout import layout
from tral_fsm.draw.panels import Panel, Resolve, mark_name, panels

INK, PALE, INNER = "#22272e", "#f6f8fa", "#eef4ff"
_MARGIN = 20
"""Room beside a heading, px."""
_HEADING, _BELOW_HEADING = 30, 10
"""Height of a heading, of which the machine below may use the last px."""
_DESCENT, _HEADING_DESCENT = 3, 4
"""Distance from the base line of a text to the end of its line, px."""
_BETWEEN = 30
"""Room between two machines, px."""
_DOT = 6
"""Radius of the dot before the root, px."""
_INSET = 3
"""Distance of the two outlines of a final state, px."""
_HEAD_LENGTH, _HEAD_HALF = 9, 4
"""Length and half width of an arrow's head, px."""


@dataclass(frozen=True)
class Line:
    """A right-angled arrow through points, with its head at the last one."""

    points: tuple[Point, ...]
    colour: str
    title: str = ""
    """Full text, which viewers show on request."""
    names: tuple[str, ...] = ()
    """Of the transitions that it stands for, see `panels.mark_name`."""

    def moved(self, down: int) -> Line:
        """The line, some px further down."""
        return replace(self, points=tuple((x, y + down) for x, y in self.points))


@dataclass(frozen=True)
class Outline:
    """A rectangle with round corners."""

    x: int
    y: int
    w: int
    h: int
    fill: str
    colour: str = INK
    strong: bool = False
    title: str = ""
    name: str = ""
    """Of the state that it stands for, see `panels.mark_name`."""

    def moved(self, down: int) -> Outline:
        """The outline, some px further down."""
        return replace(self, y=self.y + down)


@dataclass(frozen=True)
class Dot:
    """A filled circle."""

    centre: Point
    radius: int

    def moved(self, down: int) -> Dot:
        """The dot, some px further down."""
        return replace(self, centre=(self.centre[0], self.centre[1] + down))


@dataclass(frozen=True)
class Words:
    """A line of text; `at` is the left end or the middle of its base line."""

    at: Point
    text: str
    colour: str = INK
    bold: bool = False
    align: Literal["left", "middle"] = "left"

    def moved(self, down: int) -> Words:
        """The line of text, some px further down."""
        return replace(self, at=(self.at[0], self.at[1] + down))


Mark = Line | Outline | Dot | Words


@dataclass(frozen=True)
class Picture:
    """Marks in the order of their drawing; px."""

    width: int
    height: int
    marks: tuple[Mark, ...]
    title: str


def picture(machine: MachineDefinition, resolve: Resolve | None = None, direction: Direction | None = None) -> Picture:
    """Picture of a machine, and of its inner machines below it, each once.

    Args:
        machine: a checked definition.
        resolve: function from a name to its packaged machine, such as `tral_fsm.load_machine`; None: no names.
        direction: direction of most arrows; None: for each machine the one with the better picture.

    Raises:
        MachineError: the machine names another one, and `resolve` is None.
    """
    marks: list[Mark] = []
    width, height = 0, 0
    shown = panels(machine, resolve)
    for number, panel in enumerate(shown, 1):
        laid, heading = layout(panel.machine, direction=direction), panel.heading
        top = height
        if len(shown) > 1:
            marks.append(Words((_MARGIN, top + _HEADING - _HEADING_DESCENT), text.printable(heading), bold=True))
            top += _HEADING - _BELOW_HEADING
        marks += [mark.moved(top) for mark in _marks(panel, laid, number)]
        width = max(width, laid.width, text.width(heading, bold=True) + 2 * _MARGIN if len(shown) > 1 else 0)
        height = top + laid.height + (_BETWEEN if number < len(shown) else 0)
    return Picture(width, height, tuple(marks), text.printable(shown[0].heading))


def _marks(panel: Panel, laid: Arrangement, number: int) -> Iterator[Mark]:
    machine = panel.machine
    tone = {state.id: tone for state, tone in zip(machine.states, panel.tones, strict=True)}
    place = ordinals(machine)
    start, end = laid.root
    yield Line((start, end), INK, title="root")
    yield Dot(start, _DOT)
    words: list[Mark] = []
    for route in laid.routes:
        transitions = [machine.transitions[i] for i in route.transitions]
        colour = tone[transitions[0].source]
        title = text.printable("; ".join(f"{t.id}: {t.source} to {t.target}" for t in transitions))
        yield Line(route.points, colour, title, tuple(mark_name(number, each.id) for each in transitions))
        y = route.label.y
        for i, transition in zip(route.transitions, transitions, strict=True):
            for line in text.transition_lines(transition, place[i]):
                y += text.LINE
                words.append(Words((route.label.x, y - _DESCENT), line, colour))
    yield from _boxes(machine, laid, tone, number)
    yield from words


def _boxes(machine: MachineDefinition, laid: Arrangement, tone: dict[int | str, str], number: int) -> Iterator[Mark]:
    left = {transition.source for transition in machine.transitions}
    for state, box in zip(machine.states, laid.boxes, strict=True):
        inner = state.inner is not None
        title = " ".join((type(state).__doc__ or "").split())
        fill, colour = INNER if inner else PALE, tone[state.id]
        name = mark_name(number, state.id)
        yield Outline(box.x, box.y, box.w, box.h, fill, colour, state.id == machine.root, title, name)
        if state.may_end and state.id not in left:
            # A final state has a second outline.
            yield Outline(box.x + _INSET, box.y + _INSET, box.w - 2 * _INSET, box.h - 2 * _INSET, "none", colour)
        lines = text.state_lines(state)
        y = box.y + (box.h - text.LINE * (1 + len(lines))) // 2 + text.LINE - _DESCENT
        x = box.x + box.w // 2
        yield Words((x, y), text.state_name(state), bold=True, align="middle")
        for index, line in enumerate(lines, 1):
            yield Words((x, y + index * text.LINE), line, align="middle")


def arrow_head(line: Line) -> tuple[Point, ...]:
    """The triangle at the end of a line."""
    (x0, y0), (x1, y1) = line.points[-2:]
    dx, dy = (x1 > x0) - (x1 < x0), (y1 > y0) - (y1 < y0)
    x, y = x1 - _HEAD_LENGTH * dx, y1 - _HEAD_LENGTH * dy
    return (x1, y1), (x + _HEAD_HALF * dy, y + _HEAD_HALF * dx), (x - _HEAD_HALF * dy, y - _HEAD_HALF * dx)
