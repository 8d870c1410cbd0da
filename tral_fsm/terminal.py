"""Tables and bars on the terminal, for commands and for the scripts of benchmarks/."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

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


def comparison_table(shown: Mapping[str, Any]) -> Table:
    """The main figures of each contender of a comparison (`evaluation.analysis.analyse`)."""
    suite = shown["suite"]
    table = narrow_table(f"{suite['name']}, seeds {suite['seeds'][0]} to {suite['seeds'][1] - 1} ({suite['split']})")
    table.add_column("contender", no_wrap=True)
    for heading in ("drives", "success", "95 %", "score", "IQM", "95 %", "progress", "m/s"):
        table.add_column(heading, justify="right", no_wrap=True)
    for one in shown["contenders"]:
        got = one["figures"]
        success, iqm = got["success"], got["iqm"]
        table.add_row(
            one["name"],
            str(got["drives"]),
            f"{100 * success['value']:.1f} %",
            f"{100 * success['low']:.0f} to {100 * success['high']:.0f} %",
            f"{got['score']['value']:.3f}",
            f"{iqm['value']:.3f}",
            f"{iqm['low']:.3f} to {iqm['high']:.3f}",
            f"{100 * got['progress']['value']:.0f} %",
            f"{got['pace_mps']:.2f}",
        )
    return table
