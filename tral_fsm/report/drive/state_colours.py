"""Colours of states, the same in all pictures of a drive."""

from __future__ import annotations

from collections.abc import Iterable

COLOURS: tuple[tuple[int, int, int], ...] = (
    (31, 119, 180),
    (255, 127, 14),
    (44, 160, 44),
    (214, 39, 40),
    (148, 103, 189),
    (140, 86, 75),
    (227, 119, 194),
    (23, 190, 207),
    (188, 189, 34),
    (65, 68, 81),
    (120, 170, 220),
    (255, 187, 120),
    (152, 223, 138),
    (255, 152, 150),
    (197, 176, 213),
    (196, 156, 148),
    (247, 182, 210),
    (130, 220, 230),
    (219, 219, 141),
    (150, 153, 168),
)
"""RGB colours, 0 to 255: ten full tones, then ten light ones."""


class StateColours:
    """Colours of states, in the order of their first tick."""

    def __init__(self, states: Iterable[str] = ()) -> None:
        """Give the first colours to these states."""
        self._index: dict[str, int] = {}
        for state in states:
            self.rgb(state)

    @property
    def states(self) -> tuple[str, ...]:
        """The states so far."""
        return tuple(self._index)

    def rgb(self, state: str) -> tuple[int, int, int]:
        """RGB colour of a state, 0 to 255; colours repeat if there are more states."""
        index = self._index.setdefault(state, len(self._index))
        return COLOURS[index % len(COLOURS)]

    def unit(self, state: str) -> tuple[float, float, float]:
        """RGB colour of a state, 0 to 1."""
        r, g, b = self.rgb(state)
        return r / 255, g / 255, b / 255
