"""Words of a picture for the parts of a machine, and the width of words."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import get_args

from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.machine import MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.definition.prose import combined, parameters
from tral_fsm.definition.validated import SonarName

SIZE = 11
"""Height of the letters, px."""
LINE = 14
"""Distance of two lines of text, px."""
_SIDE, _ABOVE = 10, 8
"""Distance of a state's words from the sides of its box, and from its top and bottom, px."""
_WRAP = 26
"""Largest number of characters of a line."""
_MAX_CHARACTERS = 40
"""Largest number of characters of a name or value; a longer one is cut. Source: choice."""
_GLUE = "\N{NO-BREAK SPACE}"
"""Joins words of one line: a parameter, its value and its unit."""
SONARS = get_args(SonarName)

# Widths of letters in units of their size, for DejaVu Sans, the widest of the common sans-serif fonts.
_WIDTHS = {
    **dict.fromkeys("ijl'", 0.28), **dict.fromkeys("IJ|", 0.34), **dict.fromkeys(" .,:;/\\-f!()[]", 0.4),
    **dict.fromkeys("rt", 0.42), **dict.fromkeys("mW%@", 1.01), **dict.fromkeys("wMQ<>=+~", 0.87),
    **dict.fromkeys("ABCDEFGHKLNOPRSTUVXYZ&#_^", 0.79), **dict.fromkeys("csz", 0.56),
    **dict.fromkeys("abdeghknopquvxy0123456789°", 0.64),
}  # fmt: skip


def width(text: str, bold: bool = False) -> int:
    """Upper bound of the width of a line of text, px."""
    return math.ceil((1.13 if bold else 1.0) * SIZE * sum(_WIDTHS.get(letter, 1.05) for letter in text))


def size(lines: list[str]) -> tuple[int, int]:
    """Width and height of a block of lines, px."""
    return max((width(line) for line in lines), default=0), LINE * len(lines)


def state_name(state: StateSpec) -> str:
    """Id and label of a state."""
    return _cut(f"{state.id}: {state.label}" if state.label else str(state.id))


def state_lines(state: StateSpec) -> list[str]:
    """Lines with the type of a state and the parameters that differ from their defaults."""
    inner = state.inner
    held = (inner.name or "inline") if isinstance(inner, MachineDefinition) else inner
    lines = [_cut(state.type if held is None else f"{state.type}: {held}")]
    return lines + _wrapped(", ".join(_glued(parameters(state, always=False))))


def state_size(state: StateSpec) -> tuple[int, int]:
    """Width and height of a state's text with its margins, px."""
    lines = state_lines(state)
    wide, high = size(lines)
    return max(wide, width(state_name(state), bold=True)) + 2 * _SIDE, high + LINE + 2 * _ABOVE


def label_size(transitions: Sequence[TransitionSpec], ordinals: Sequence[str]) -> tuple[int, int]:
    """Width and height of the text of bundled transitions, px."""
    return size([line for t, place in zip(transitions, ordinals, strict=True) for line in transition_lines(t, place)])


def transition_lines(transition: TransitionSpec, place: str = "") -> list[str]:
    """Lines with the condition of a transition.

    Args:
        transition: the transition.
        place: its ordinal among those that leave its state, for the start of the first line.
    """
    return _wrapped(place.replace(" ", _GLUE) + condition(transition.when))


def condition(spec: ConditionSpec) -> str:
    """A condition as one line: its type and its values."""
    return combined(spec, _simple)


def _simple(spec: ConditionSpec) -> str:
    words = _glued(parameters(spec, always=True))
    # "SensorLevel front > 1.2 m, readings 2": the sonar stays with its limit.
    first = 2 if len(words) > 1 and words[0] in SONARS else 1
    return " ".join([spec.type, ", ".join([_GLUE.join(words[:first]), *words[first:]])]).strip()


def printable(words: str) -> str:
    """Words as one line, without characters that no picture can show."""
    flat = " ".join(words.split())
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in flat)


def _glued(words: Iterable[str]) -> list[str]:
    return [_cut(word).replace(" ", _GLUE) for word in words]


def _cut(word: str) -> str:
    flat = printable(word)
    return flat if len(flat) <= _MAX_CHARACTERS else flat[: _MAX_CHARACTERS - 1] + "…"


def _wrapped(text: str) -> list[str]:
    return [line.replace(_GLUE, " ") for line in textwrap.wrap(text, _WRAP, break_on_hyphens=False)]
