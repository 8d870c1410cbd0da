"""The terminal's view of a search: a bar while it runs, tables at its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from tral_fsm.cli.terminal import print_figures

if TYPE_CHECKING:
    from pathlib import Path

    from rich.table import Table

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


_CAPTION = "RMSE, time, steering: courses where both arrive. The cost of all courses is the sum of the rows below it."


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

    from tral_fsm.tuning.tables import CHECK_HEADER, check_rows

    title = f"On {comparison.courses} courses that nothing was tuned on, with 95 % intervals"
    table = Table(title=Text(title), title_justify="left", caption=Text(_CAPTION), caption_justify="left")
    for heading in CHECK_HEADER:
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for row in check_rows(comparison):
        table.add_row(*(Text(cell) for cell in row), end_section=row[0] in ("collisions", "steering [1/m]"))
    return table
