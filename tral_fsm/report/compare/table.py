"""The main figures of a comparison as a table of the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tral_fsm.report.compare.cells import NOTHING, cell, programs_note
from tral_fsm.terminal import narrow_table

if TYPE_CHECKING:
    from rich.table import Table


def table(shown: dict[str, Any]) -> Table:
    """The main figures of each contender."""
    suite = shown["suite"]
    title = f"{suite['name']}, seeds {suite['seeds'][0]} to {suite['seeds'][1] - 1} ({suite['split']})"
    table = narrow_table(title, programs_note(shown["runs"]))
    table.add_column("contender", no_wrap=True)
    for heading in ("drives", "success", "95 %", "score", "IQM", "95 %", "m/s"):
        table.add_column(heading, justify="right", no_wrap=True)
    for one in shown["contenders"]:
        got = one["figures"]
        _, success_range = cell(got["success"], 100.0, 0)
        iqm, iqm_range = cell(got["iqm"], 1.0, 3)
        table.add_row(
            one["name"],
            str(got["drives"]),
            f"{100 * got['success']['value']:.1f} %",
            f"{success_range} %",
            f"{got['score']['value']:.3f}",
            iqm,
            iqm_range or NOTHING,
            f"{got['pace_mps']:.2f}",
        )
    return table
