"""What a person has in hand at the terminal: devices of the command line, the terminal as the console, the report."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from tral_fsm.cli.console import FAILED
from tral_fsm.teleop.hands import Device

Gamepad = Annotated[
    bool, typer.Option("--gamepad", help="Use an XBOX gamepad (extra `gamepad`): LB is the dead man's button, B stops.")
]
GamepadFile = Annotated[
    str | None, typer.Option(help="File of the gamepad, such as /dev/input/event5, instead of the first one.")
]
_STDERR = 2
_WITHOUT_TERMINAL_S = 2.0
"""Where the status is no line that is renewed, a new one comes this often, s."""


class TerminalConsole:
    """Status and words on stderr. A terminal that does not take them, such as that of a stalled ssh, delays nobody."""

    def __init__(self) -> None:
        from tral_fsm.terminal import StatusLine

        self._line = StatusLine(_STDERR, time.monotonic, _WITHOUT_TERMINAL_S)

    def status(self, text: str) -> None:
        """Show the line of the moment."""
        self._line.show(text)

    def say(self, text: str) -> None:
        """Tell something that stays."""
        self._line.say(text)


@contextlib.contextmanager
def devices(gamepad: bool, gamepad_file: str | None, keyboard: Any) -> Iterator[list[Device]]:
    """Open what is there: the gamepad first, if it is asked for, then the keyboard of a terminal.

    Args:
        gamepad: whether a gamepad is asked for.
        gamepad_file: its file; None: the first.
        keyboard: makes a device of a terminal.
    """
    from tral_fsm.teleop.keyboard import Terminal

    with contextlib.ExitStack() as stack:
        found: list[Device] = []
        if gamepad or gamepad_file is not None:
            from tral_fsm.teleop.gamepad import open_gamepad

            found.append(open_gamepad(gamepad_file))
            stack.callback(found[0].close)
        if sys.stdin is not None and sys.stdin.isatty():
            found.append(keyboard(stack.enter_context(Terminal())))
        yield found


def tell(report: Mapping[str, Any], out: Path, as_json: bool) -> None:
    """Tell how a drive ended; the exit code is 1 if nobody wished for that end.

    Args:
        report: content of summary.json.
        out: folder of the files.
        as_json: whether the report alone goes to stdout.
    """
    from tral_fsm.cli.show_car import table_of_car_drive
    from tral_fsm.terminal import print_figures

    if as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        print_figures(table_of_car_drive(report))
        typer.echo(f"Files: {out}")
    if report["failed"]:
        raise typer.Exit(FAILED)
