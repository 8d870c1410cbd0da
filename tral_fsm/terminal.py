"""Tables and bars on the terminal, for commands and for the scripts of benchmarks/."""

from __future__ import annotations

import contextlib
import math
import os
import select
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


def narrow_table(title: str = "", caption: str = "") -> Table:
    """A table without vertical lines and with little room between them, so that 80 characters hold much."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    return Table(
        title=Text(title) if title else None, title_justify="left",
        caption=Text(caption) if caption else None, caption_justify="left",
        box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, collapse_padding=True,
    )  # fmt: skip


def print_figures(table: Table) -> None:
    """Print a table of figures at its full width, even if the terminal is narrower."""
    from rich.console import Console

    console = Console()
    full = console.measure(table, options=console.options.update(max_width=sys.maxsize)).maximum
    Console(width=max(console.width, full)).print(table)


@contextlib.contextmanager
def drives_bar(total: int) -> Iterator[Callable[[], None]]:
    """A bar of drives on stderr; it gives a function that counts one."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as bar:
        task = bar.add_task("drives", total=total)
        yield lambda: bar.advance(task)


class StatusLine:
    """A line that is renewed in place. What the terminal does not take at once is left out: nobody waits for it."""

    def __init__(self, file: int, clock: Callable[[], float], otherwise_s: float) -> None:
        """Write to a file.

        Args:
            file: its descriptor.
            clock: a clock that never goes back, s.
            otherwise_s: where the file is no terminal, a new line comes this often, s.
        """
        self._file, self._clock, self._otherwise_s = file, clock, otherwise_s
        self._is_terminal, self._last_s = os.isatty(file), -math.inf

    def show(self, text: str) -> None:
        """Show the line of the moment."""
        if self._is_terminal:
            self._write(f"\r{text[: self._columns() - 1]}\x1b[K")
        elif self._clock() - self._last_s >= self._otherwise_s:
            self._last_s = self._clock()
            self._write(f"{text}\n")

    def say(self, text: str) -> None:
        """Write a line that stays."""
        self._write(f"\r\x1b[K{text}\n" if self._is_terminal else f"{text}\n")

    def clear(self) -> None:
        """Remove the line of the moment, so that another stream can write on the terminal."""
        if self._is_terminal:
            self._write("\r\x1b[K")

    def _columns(self) -> int:
        try:
            return os.get_terminal_size(self._file).columns or _COLUMNS
        except OSError:
            return _COLUMNS

    def _write(self, text: str) -> None:
        poll = select.poll()
        poll.register(self._file, select.POLLOUT)
        with contextlib.suppress(OSError):
            if poll.poll(0):
                os.write(self._file, text.encode()[: select.PIPE_BUF])


_COLUMNS = 80
"""Width of a terminal that does not say it."""
