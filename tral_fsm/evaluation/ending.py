"""A program that the system tells to end ends as at Ctrl-C: it keeps its results, and its workers end with it."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


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


@contextlib.contextmanager
def ending_cleanly() -> Iterator[None]:
    """Within it SIGTERM and SIGHUP raise `ToldToEnd`; a second one ends the process at once.

    A signal that is ignored (nohup) or has a handler of its own keeps it, and only the main thread can take signals.
    """
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    is_main = threading.current_thread() is threading.main_thread()
    taken = [number for number in numbers if is_main and signal.getsignal(number) is signal.SIG_DFL]

    def give_back() -> None:
        for number in taken:
            if signal.getsignal(number) is end:
                signal.signal(number, signal.SIG_DFL)

    def end(number: int, frame: FrameType | None) -> None:
        give_back()
        raise ToldToEnd(number)

    for number in taken:
        signal.signal(number, end)
    try:
        yield
    finally:
        give_back()
