"""Tables and bars on the terminal, for commands and for the scripts of benchmarks/."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


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
