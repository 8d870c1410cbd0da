"""Colours of states, the same in all pictures of a drive and in the picture of its machine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from tral_fsm.draw.panels import TONES


class StateColours:
    """Colours of states: those that are given, and for other states the next ones, in the order of their first tick."""

    def __init__(self, states: Iterable[str] = (), given: Mapping[str, str] | None = None) -> None:
        """Take given colours, and give the next ones to other states.

        Args:
            states: names of states, in the order of their first tick.
            given: name -> colour such as "#0b5cad", as `tral_fsm.draw.panels.state_tones` gives them for a machine.
        """
        self._tones = dict(given or {})
        self._states: dict[str, None] = {}
        for state in states:
            self.tone(state)

    @property
    def states(self) -> tuple[str, ...]:
        """The states so far."""
        return tuple(self._states)

    def tone(self, state: str) -> str:
        """Colour of a state, such as "#0b5cad"; colours repeat if there are more states."""
        self._states[state] = None
        return self._tones.setdefault(state, TONES[len(self._tones) % len(TONES)])

    def rgb(self, state: str) -> tuple[int, int, int]:
        """RGB colour of a state, 0 to 255."""
        r, g, b = bytes.fromhex(self.tone(state)[1:])
        return r, g, b
