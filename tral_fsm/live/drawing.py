"""The machine as its drawing, with the active state lit, and why it came there."""

from __future__ import annotations

import html
from typing import Any

import viser

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.draw.panels import marks_of_states, marks_of_transitions, state_tones
from tral_fsm.draw.picture import Outline, picture
from tral_fsm.draw.svg import lit, svg
from tral_fsm.formats.library import load
from tral_fsm.live.frame import CarFrame

_HEIGHT_PX = 340
_ZOOM = 0.9
_TRANSITION_S = 1.5
"""The transition that fired last stays lit for so long."""
_FRAME = (
    "<style>#machine{position:relative;overflow:hidden;height:%dpx;border:1px solid #ccc;background:white}"
    "#machine svg{position:absolute;transition:transform .3s;transform-origin:0 0}</style>"
    '<div id="machine">%s</div>'
)


class Drawing:
    """The drawing in a panel."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Draw nothing yet."""
        self._whole = gui.add_checkbox("whole machine", False, hint="else the drawing follows the active state")
        self._reason = gui.add_markdown("")
        self._svg = gui.add_html("")
        self._style = gui.add_html("")
        self._machine: MachineDefinition | None = None
        self._boxes: dict[str, Outline] = {}
        self._lit: Any = None
        self.tones: dict[str, str] = {}
        """Colour of each state by its name in a drive."""

    def draw(self, machine: MachineDefinition | None) -> None:
        """Draw another machine; None: none drives."""
        self._machine, self._lit = machine, None
        if machine is None:
            self._svg.content, self._style.content, self.tones = "", "", {}
            self._reason.content = "The driver is no machine: it has no states."
            return
        drawn = picture(machine, load)
        self._size = drawn.width, drawn.height
        self._boxes = {mark.name: mark for mark in drawn.marks if isinstance(mark, Outline) and mark.name}
        self._states, self._transitions = marks_of_states(machine, load), marks_of_transitions(machine, load)
        self.tones = state_tones(machine, load)
        self._svg.content = _FRAME % (_HEIGHT_PX, svg(drawn))

    def show(self, car: CarFrame) -> None:
        """Light the active state, and the transition that fired last if that was a moment ago."""
        if self._machine is None:
            return
        fired = car.transit
        fresh = fired is not None and car.time_s - fired.time < _TRANSITION_S
        wanted = (car.state, fired if fresh else None, self._whole.value)
        if wanted == self._lit:
            return
        self._lit = wanted
        marks = self._states.get(car.state, ())
        lines = [self._transitions[fired.path, fired.transition]] if fired is not None and fresh else []
        self._style.content = f"<style>{lit(marks, lines)}\n{self._transform(marks)}</style>"
        self._reason.content = reason(car)

    def _transform(self, marks: tuple[str, ...]) -> str:
        """How the drawing is moved: to the active state, or to all of it."""
        if self._whole.value or not marks:
            scale = min(380 / self._size[0], _HEIGHT_PX / self._size[1], 1.0)
            return f"#machine svg{{transform:scale({scale:.3f});left:0;top:0}}"
        box = self._boxes[marks[-1]]
        x, y = _ZOOM * (box.x + box.w / 2), _ZOOM * (box.y + box.h / 2)
        return f"#machine svg{{left:50%;top:50%;transform:translate({-x:.0f}px,{-y:.0f}px) scale({_ZOOM})}}"


def reason(car: CarFrame) -> str:
    """The active state, and the values that were compared when the machine last changed it, as Markdown."""
    lines = [f"**{plain(car.state) or '-'}**"]
    if car.transit is not None:
        fired = car.transit
        lines.append(
            f"at {fired.time:.2f} s from **{plain(str(fired.source))}** to **{plain(str(fired.target))}** by "
            f"*{plain(str(fired.transition))}*: {plain(fired.why)}"
        )
    return "\n\n".join(lines)


def plain(words: str) -> str:
    """Words that Markdown shows as they are."""
    return "".join(
        f"\\{letter}" if letter in r"\`*_{}[]()#+-.!|<>$~" else letter for letter in html.escape(words, False)
    )
