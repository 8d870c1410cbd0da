"""A machine as lines, boxes and words, the same for all kinds of pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

from tral_env.errors import MachineError
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.draw import text
from tral_fsm.draw.layered.content import ordinals
from tral_fsm.draw.layered.shapes import Arrangement, Direction, Point
from tral_fsm.draw.layout import layout

INK, PALE, INNER = "#22272e", "#f6f8fa", "#eef4ff"
_TONES = ("#0b5cad", "#b3261e", "#1b7f3b", "#7a3db8", "#a85a00", "#00707a", "#a3195b", "#5a6472", "#5f6b00", "#3f3fbf")
"""Colours of the arrows that leave a state, one state after the other; each is readable on white."""
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

Resolve = Callable[[str], MachineDefinition]


@dataclass(frozen=True)
class Line:
    """A right-angled arrow through points, with its head at the last one."""

    points: tuple[Point, ...]
    colour: str
    title: str = ""
    """Full text, which viewers show on request."""

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
    panels = list(_panels(machine, resolve))
    for number, (heading, part) in enumerate(panels, 1):
        laid = layout(part, direction=direction)
        top = height
        if len(panels) > 1:
            marks.append(Words((_MARGIN, top + _HEADING - _HEADING_DESCENT), text.printable(heading), bold=True))
            top += _HEADING - _BELOW_HEADING
        marks += [mark.moved(top) for mark in _marks(part, laid)]
        width = max(width, laid.width, text.width(heading, bold=True) + 2 * _MARGIN if len(panels) > 1 else 0)
        height = top + laid.height + (_BETWEEN if number < len(panels) else 0)
    return Picture(width, height, tuple(marks), text.printable(panels[0][0]))


def _panels(machine: MachineDefinition, resolve: Resolve | None) -> Iterator[tuple[str, MachineDefinition]]:
    """Headings and machines, outer ones first; each machine comes once."""
    front: list[tuple[str, MachineDefinition]] = [(machine.name or "machine", machine)]
    seen: set[str] = set()
    inline: set[int] = set()
    """Identities of machines that stand in a state."""
    while front:
        heading, here = front.pop(0)
        yield heading, here
        for state in here.states:
            inner = state.inner
            if isinstance(inner, MachineDefinition):
                if id(inner) in inline:
                    continue
                inline.add(id(inner))
                front.append((f"{inner.name or 'inline'}, in state {text.state_name(state)}", inner))
            elif inner is not None and inner not in seen:
                seen.add(inner)
                if resolve is None:
                    raise MachineError(
                        f"state {text.state_name(state)} names the machine {inner!r}, and nothing says which one that "
                        "is: give picture(..., resolve=tral_fsm.load_machine)"
                    )
                front.append((inner, resolve(inner)))


def _marks(machine: MachineDefinition, laid: Arrangement) -> Iterator[Mark]:
    tone = {state.id: _TONES[i % len(_TONES)] for i, state in enumerate(machine.states)}
    place = ordinals(machine)
    start, end = laid.root
    yield Line((start, end), INK, title="root")
    yield Dot(start, _DOT)
    words: list[Mark] = []
    for route in laid.routes:
        transitions = [machine.transitions[i] for i in route.transitions]
        colour = tone[transitions[0].source]
        title = text.printable("; ".join(f"{t.id}: {t.source} to {t.target}" for t in transitions))
        yield Line(route.points, colour, title=title)
        y = route.label.y
        for i, transition in zip(route.transitions, transitions, strict=True):
            for line in text.transition_lines(transition, place[i]):
                y += text.LINE
                words.append(Words((route.label.x, y - _DESCENT), line, colour))
    yield from _boxes(machine, laid, tone)
    yield from words


def _boxes(machine: MachineDefinition, laid: Arrangement, tone: dict[int | str, str]) -> Iterator[Mark]:
    left = {transition.source for transition in machine.transitions}
    for state, box in zip(machine.states, laid.boxes, strict=True):
        inner = state.inner is not None
        title = " ".join((type(state).__doc__ or "").split())
        fill, colour = INNER if inner else PALE, tone[state.id]
        yield Outline(box.x, box.y, box.w, box.h, fill, colour, state.id == machine.root, title)
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
