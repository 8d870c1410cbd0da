"""The main figures of a comparison as a table of the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tral_fsm.terminal import narrow_table

if TYPE_CHECKING:
    from rich.table import Table


def table(shown: dict[str, Any]) -> Table:
    """The main figures of each contender."""
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
