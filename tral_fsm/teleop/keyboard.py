"""The keyboard, also over ssh: a terminal says which keys were pressed, and never that one was let go."""

from __future__ import annotations

import math
import os
import select
import sys
import termios
import tty
from typing import Any, Self

from tral_env.errors import ConfigError, SourceLostError
from tral_fsm.teleop.hands import Hands

ARROWS = {b"\x1b[A": "w", b"\x1b[B": "s", b"\x1b[C": "d", b"\x1b[D": "a"}
"""What a terminal sends for an arrow -> the letter that means the same."""
_MAX_BYTES = 4096


class Terminal:
    """A terminal that gives each key at once, within its ``with`` block."""

    def __init__(self, file: int | None = None) -> None:
        """Name a terminal by its file descriptor; None: the standard input.

        Raises:
            ConfigError: it is no terminal.
        """
        self._file = sys.stdin.fileno() if file is None else file
        if not os.isatty(self._file):
            raise ConfigError("the standard input is no terminal: no key could stop the car")
        self._before: list[Any] | None = None

    def __enter__(self) -> Self:
        """Take keys at once, without showing them; Ctrl-C stays a signal."""
        self._before = termios.tcgetattr(self._file)
        tty.setcbreak(self._file, termios.TCSANOW)
        return self

    def __exit__(self, *_: object) -> None:
        """Set the terminal back as it was."""
        if self._before is not None:
            try:
                termios.tcsetattr(self._file, termios.TCSANOW, self._before)
            except termios.error:  # it is gone, and nobody is left to mind
                return

    def keys(self) -> str:
        """Letters of the keys that were pressed since the last call, arrows as w, s, a, d.

        Raises:
            SourceLostError: the terminal is gone.
        """
        if not select.select([self._file], [], [], 0)[0]:
            return ""
        try:
            typed = os.read(self._file, _MAX_BYTES)
        except OSError as error:
            raise SourceLostError(f"the terminal is gone ({error})") from error
        if not typed:
            raise SourceLostError("the terminal is gone")
        for code, letter in ARROWS.items():
            typed = typed.replace(code, letter.encode())
        return typed.decode("ascii", "replace").lower()


class Keyboard:
    """Drives by keys: w forward, s brake and back, a left, d right, + and - the throttle; space stops, r arms, q ends.

    Keys that are held repeat. While w or s repeats, or a or d, the throttle stays; `hold_s` after the last key the car
    is in neutral: that is its dead man's button. The first repetition of a held key comes after half a second.
    """

    def __init__(self, terminal: Terminal, hold_s: float = 0.7, step: float = 0.1) -> None:
        """Drive by a terminal.

        Args:
            terminal: gives the keys.
            hold_s: a key counts for so long, s.
            step: change of the throttle by + and -, share of its end.
        """
        self.name = "keyboard"
        self._terminal, self._hold_s, self._step = terminal, hold_s, step
        self._level, self._direction, self._side = 0.6, 0.0, 0.0
        self._driven_s = self._steered_s = -math.inf

    def poll(self, now_s: float) -> Hands:
        """See `Device.poll`."""
        keys = self._terminal.keys()
        for key in keys:
            if key in "ws":
                self._direction, self._driven_s = (1.0 if key == "w" else -1.0), now_s
            elif key in "ad":
                self._side, self._steered_s = (1.0 if key == "a" else -1.0), now_s
            elif key in "+-":
                self._level = min(max(self._level + (self._step if key == "+" else -self._step), 0.0), 1.0)
        steers = now_s - self._steered_s <= self._hold_s
        holds = steers or now_s - self._driven_s <= self._hold_s
        self._direction *= holds
        return Hands(
            self._side * steers, self._direction * self._level, holds, "r" in keys, " " in keys, "q" in keys
        )  # fmt: skip

    def close(self) -> None:
        """Do nothing: the terminal is set back at the end of its ``with`` block."""


class StopKeys:
    """The keyboard beside a policy: r arms, q ends, and any other key is the emergency stop."""

    def __init__(self, terminal: Terminal) -> None:
        self.name = "keyboard"
        self._terminal = terminal

    def poll(self, now_s: float) -> Hands:
        """See `Device.poll`."""
        del now_s
        keys = self._terminal.keys()
        return Hands(arm="r" in keys, stop=bool(set(keys) - {"r", "q"}), end="q" in keys)

    def close(self) -> None:
        """Do nothing: the terminal is set back at the end of its ``with`` block."""
