"""The terminal's view of a recorded drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import typer

from tral_fsm.terminal import narrow_table, print_figures

if TYPE_CHECKING:
    from rich.table import Table


def print_replay(report: Mapping[str, Any]) -> None:
    """Print the tables of a replay."""
    from tral_fsm.cli.show import table_of_drive

    if report["episode"] is not None:
        print_figures(table_of_drive([report["episode"]], str(report["file"])))
    print_figures(_table_of_recording(report))
    if report["damage"]:
        typer.echo(f"The file is {report['damage']}; what stands before is all here.")
    if "against_simulation" in report:
        print_figures(_table_of_residuals(report["against_simulation"]))
    if "policy" in report:
        print_figures(_table_of_answers(report["policy"]))


def _table_of_recording(report: Mapping[str, Any]) -> Table:
    table = narrow_table("recording" if report["episode"] else f"recording {report['file']}")
    for heading in ("source", "ticks", "missing", "time", "way", "late\nticks", "largest\nlateness"):
        table.add_column(heading, justify="left" if heading == "source" else "right", no_wrap=True)
    table.add_row(
        report["source"],
        str(report["ticks"]),
        str(report["missing_ticks"]),
        f"{report['time_s']:.1f} s",
        f"{report['distance_m']:.1f} m",
        str(report["late_ticks"]),
        f"{1000 * report['max_lateness_s']:.1f} ms",
    )
    return table


def _table_of_residuals(report: Mapping[str, Any]) -> Table:
    from tral_fsm.evaluation.replayed import QUANTITIES

    ended = f"the simulated drive ended early: {report['ended'].replace('_', ' ')}" if report["ended"] else ""
    table = narrow_table("recorded minus simulated, on the same commands", ended)
    for heading in ("quantity", "RMS", "largest", "ticks"):
        table.add_column(heading, justify="left" if heading == "quantity" else "right", no_wrap=True)
    for name, unit in QUANTITIES.items():
        found = report["residuals"][name]
        cells = ("-", "-") if found["rms"] is None else (f"{found[key]:.4f} {unit}" for key in ("rms", "largest"))
        table.add_row(name.replace("_", " "), *cells, str(found["ticks"]))
    return table


def _table_of_answers(report: Mapping[str, Any]) -> Table:
    drove = "the machine that drove" if report["drove"] else "another policy drove"
    table = narrow_table(f"answers of {report['policy']} minus the recorded ones", drove)
    for heading in ("command", "RMS", "largest", "ticks that differ"):
        table.add_column(heading, justify="left" if heading == "command" else "right", no_wrap=True)
    for name in ("steering", "throttle"):
        found = report[name]
        differ = f"{found['different']} of {report['ticks']}"
        table.add_row(name, f"{found['rms']:.4f}", f"{found['largest']:.4f}", differ)
    return table
