"""A program that the system tells to end ends as at Ctrl-C: it keeps its results, and its workers end with it."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from tral_fsm.starting import quit_at_once


class ToldToEnd(KeyboardInterrupt):
    """SIGTERM or SIGHUP came."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number
        """Number of the signal."""

    @property
    def exit_code(self) -> int:
        """Exit code of a program that a signal ended, as shells have it."""
        return 128 + self.number


_IMPORTS = "<frozen importlib._bootstrap>"
"""File of the frames of an import."""
_AGAIN_S = 0.02
"""A signal that came during an import comes again after this time, s."""
_PATIENCE = 100
"""A signal comes again so often, 2 s in all: an import may be the user's own file, and never end."""


class WaitForImport:
    """Lets a signal wait until an import is done: half a library words an interrupt as a fault of its own."""

    def __init__(self) -> None:
        self._left = _PATIENCE

    def __call__(self, number: int, frame: FrameType | None) -> bool:
        """Whether the signal has to wait; then it comes again by itself.

        Args:
            number: of the signal.
            frame: what the main thread does, as a handler is told it.
        """
        while frame is not None and frame.f_code.co_filename != _IMPORTS:
            frame = frame.f_back
        if frame is None or not self._left:
            self._left = _PATIENCE
            return False
        self._left -= 1
        again = threading.Timer(_AGAIN_S, _send_to_main_thread, (number,))
        again.daemon = True
        again.start()
        return True


def _send_to_main_thread(number: int) -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, number)  # a signal to another thread would not wake it
    else:
        signal.raise_signal(number)


@contextlib.contextmanager
def interrupted_between_imports() -> Iterator[None]:
    """Within it Ctrl-C raises KeyboardInterrupt as ever, but not amid an import; afterwards all is as before.

    A signal that is ignored or has a handler of somebody else keeps it, and only the main thread can take signals.
    """
    is_main = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT)
    if not is_main or before not in (signal.default_int_handler, quit_at_once):
        yield
        return
    waits = WaitForImport()

    def interrupt(number: int, frame: FrameType | None) -> None:
        if not waits(number, frame):
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def ending_cleanly() -> Iterator[None]:
    """Within it SIGTERM and SIGHUP raise `ToldToEnd`; a second one ends the process at once.

    A signal that is ignored (nohup) or has a handler of its own keeps it, and only the main thread can take signals.
    """
    waits = WaitForImport()
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    is_main = threading.current_thread() is threading.main_thread()
    taken = [number for number in numbers if is_main and signal.getsignal(number) is signal.SIG_DFL]

    def give_back() -> None:
        for number in taken:
            if signal.getsignal(number) is end:
                signal.signal(number, signal.SIG_DFL)

    def end(number: int, frame: FrameType | None) -> None:
        if waits(number, frame):
            return
        give_back()
        raise ToldToEnd(number)

    for number in taken:
        signal.signal(number, end)
    try:
        yield
    finally:
        give_back()
