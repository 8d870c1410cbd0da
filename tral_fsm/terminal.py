"""Tables and bars on the terminal, for commands and for the scripts of benchmarks/."""

from __future__ import annotations

import contextlib
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
