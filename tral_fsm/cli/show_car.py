"""The terminal's view of a drive in the real car."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from tral_fsm.terminal import narrow_table

if TYPE_CHECKING:
    from rich.table import Table


def table_of_car_drive(report: Mapping[str, Any]) -> Table:
    """Table of a drive: its end, time and way, lateness, the time in each state, and the warnings."""
    from rich.text import Text

    figures = report["figures"]
    table = narrow_table(str(report["arguments"].get("policy", "by hand")))
    table.add_column("", no_wrap=True)
    table.add_column("", justify="left", overflow="fold", max_width=100)
    late = figures["lateness_ms"]
    share = figures["late_ticks"] / figures["ticks"] if figures["ticks"] else 0.0
    rows = {
        "ended by": report["ended_by"],
        "time": f"{figures['time_s']:.1f} s, {figures['ticks']} ticks",
        "way": f"{figures['distance_m']:.1f} m, {figures['mean_speed_mps']:.2f} m/s in the mean",
        "late ticks": f"{figures['late_ticks']} ({share:.1%})",
        "lateness": f"p50 {late['p50']:.1f}, p99 {late['p99']:.1f}, max {late['max']:.1f} ms",
        "tried again": f"{figures['retries']} transactions",
        "states": ", ".join(f"{name or '-'} {time_s:.1f} s" for name, time_s in figures["states_s"].items()),
        "warnings": "; ".join(report["warnings"]) or "none",
    }
    for name, value in rows.items():
        style = "red" if name == "ended by" and report["failed"] else ""
        table.add_row(name, Text(value, style=style))
    return table
