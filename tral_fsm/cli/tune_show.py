"""The terminal's view of a search: a bar while it runs, tables at its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from tral_fsm.cli.terminal import print_figures

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from rich.table import Table

    from tral_fsm.evaluation.statistics import Estimate
    from tral_fsm.tuning import Progress, Stage, Tuned
    from tral_fsm.tuning.holdout import Comparison


STAGES = {
    "as it was": "the machine as it was",
    "search": "search",
    "finals": "finals on fresh courses",
    "check": "check on held-out courses",
    "around": "report: cost around the result",
    "steps": "report: steps in clearance",
}
"""Name of a stage -> text of the bar."""


class Bar:
    """Progress on stderr: a line for each stage; the line of the search shows the lowest cost so far."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.completed:.0f}/{task.total:.0f} {task.fields[unit]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
        )
        self._tasks: dict[str, TaskID] = {}
        self._best = ""

    def __enter__(self) -> Bar:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Stop the bar."""
        self._bar.stop()

    def best(self, progress: Progress) -> None:
        """Show the cost of the best candidate."""
        self._best = f": cost {progress.best.cost:.3f} (was {progress.old.cost:.3f})"
        self._update("search", progress.drives, progress.budget, "drives")

    def stage(self, stage: Stage) -> None:
        """Show the progress of a stage."""
        self._update(stage.name, stage.done, stage.total, stage.unit)

    def _update(self, name: str, done: int, total: int, unit: str) -> None:
        said = STAGES[name] + (self._best if name == "search" else "")
        if name not in self._tasks:
            self._tasks[name] = self._bar.add_task(said, total=total, unit=unit)
        # The last generation is finished even beyond the budget.
        self._bar.update(self._tasks[name], completed=min(done, total), description=said)


def print_result(tuned: Tuned, out: Path) -> None:
    """Print the parameters that were found, and the result of the check."""
    if tuned.values is not None:
        print_figures(_parameters(tuned))
    if tuned.comparison is not None:
        print_figures(_held_out(tuned.comparison))
    typer.echo(tuned.verdict)
    typer.echo(f"Files: {out}")


def _parameters(tuned: Tuned) -> Table:
    from rich.table import Table
    from rich.text import Text

    from tral_fsm.tuning.tables import before_cell

    table = Table(title=Text("Parameters"), title_justify="left")
    for heading in ("parameter", "was", "now"):
        table.add_column(heading, justify="left" if heading == "parameter" else "right")
    for each, value in zip(tuned.parameters, tuned.values or (), strict=True):
        unit = f" [{each.unit}]" if each.unit else ""
        table.add_row(Text(each.label + unit), before_cell(each), str(value))
    return table


def _held_out(comparison: Comparison) -> Table:
    from rich.table import Table
    from rich.text import Text

    from tral_fsm.tuning.tables import estimate_cell

    table = Table(title=Text("On courses that nothing was tuned on, with 95 % intervals"), title_justify="left")
    for heading in ("", "was", "now", "difference"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    old, new = comparison.old, comparison.new
    split = f"{comparison.only_new} gained, {comparison.only_old} lost"
    table.add_row("success", *(estimate_cell(each.success, 100.0, 0) + " %" for each in (old, new)), split)
    rows: Mapping[str, tuple[Estimate, Estimate, Estimate, float]] = {
        "clearance RMSE [cm]": (old.clearance_rmse_m, new.clearance_rmse_m, comparison.clearance_m, 100.0),
        "settled RMSE [cm]": (old.settled_rmse_m, new.settled_rmse_m, comparison.settled_m, 100.0),
        "time [s/m]": (old.time_per_m, new.time_per_m, comparison.time_per_m, 1.0),
        "cost": (old.cost, new.cost, comparison.cost, 1.0),
    }
    for name, (was, now, difference, scale) in rows.items():
        cells = (estimate_cell(was, scale), estimate_cell(now, scale), estimate_cell(difference, scale, 2, "+"))
        table.add_row(Text(name), *cells)
    return table
