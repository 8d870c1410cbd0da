"""Ctrl-C while the program `tral` starts: it ends without a word, since there is nothing to keep yet.

The package imports this module before all others, which take a second. In any other program it does nothing.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

PROGRAM = ("tral", "tral.exe", "tral-script.py")
"""File names of the program, on Linux and on Windows."""


def quit_at_once(number: int, frame: FrameType | None) -> None:
    """Handler that ends the process with the exit code that shells give to a signal."""
    os._exit(128 + number)  # an exception would come out of half a library, in that library's words


def guard_start() -> None:
    """Let Ctrl-C end the program at once, if this is `tral` and nobody else takes or ignores the signal."""
    name = os.path.basename(sys.argv[0]) if getattr(sys, "argv", None) else ""  # noqa: PTH119 - pathlib takes time
    if name in PROGRAM and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, quit_at_once)


guard_start()
