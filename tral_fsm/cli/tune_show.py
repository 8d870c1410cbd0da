"""The terminal's view of a search: a bar while it runs, tables at its end."""

from __future__ import annotations

import json
from collections import Counter
from typing import TYPE_CHECKING, Any

import typer

from tral_fsm.terminal import narrow_table, print_figures
from tral_fsm.tuning.folder import MACHINE, PAGE, STUDY

if TYPE_CHECKING:
    from pathlib import Path

    from rich.table import Table

    from tral_fsm.definition.machine import MachineDefinition
    from tral_fsm.tuning import Progress, Stage, Tuned
    from tral_fsm.tuning.holdout import Comparison
    from tral_fsm.tuning.listing import Listed


_STAGES = {
    "as it was": "the machine as it was",
    "search": "search",
    "finals": "finals on fresh courses",
    "check": "check on held-out drives",
    "around": "report: cost around the result",
    "steps": "report: steps in clearance",
}
"""`StageName` -> text of the bar."""


_CAPTION = "RMSE, time, steering: where both arrive. The cost of all drives is the sum of the rows below it."


class Bar:
    """Progress on stderr: a line for each stage; the line of the search shows the lowest cost so far."""

    def __init__(self) -> None:
        from rich import progress as rich
        from rich.console import Console

        self._bar = rich.Progress(
            rich.TextColumn("{task.description}", markup=False),
            rich.BarColumn(bar_width=12),
            rich.TextColumn("{task.completed:.0f}/{task.total:.0f} {task.fields[unit]}"),
            rich.TimeElapsedColumn(),
            rich.TimeRemainingColumn(),
            console=Console(stderr=True),
        )
        self._tasks: dict[str, rich.TaskID] = {}
        self._best = ""
        self.progress: Progress | None = None
        """Progress of the search; None before a candidate has driven all courses."""

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
        self.progress = progress
        cost, was = f"{progress.best.cost:.3f}", f"{progress.old.cost:.3f}"
        self._best = f": cost {cost} (was {was})" if progress.better else f": none better than {was} yet"
        self._update("search", progress.drives, progress.budget, "drives")

    def note(self, said: str) -> None:
        """Print a line above the bar."""
        self._bar.console.print(said, markup=False, highlight=False, soft_wrap=True)

    def stage(self, stage: Stage) -> None:
        """Show the progress of a stage."""
        self._update(stage.name, stage.done, stage.total, stage.unit)

    def _update(self, name: str, done: int, total: int, unit: str) -> None:
        said = _STAGES[name] + (self._best if name == "search" else "")
        if name not in self._tasks:
            self._tasks[name] = self._bar.add_task(said, total=total, unit=unit)
        self._bar.update(self._tasks[name], completed=done, description=said)


def kept_text(progress: Progress | None, out: Path, storage: str | None) -> str:
    """What an interrupted search leaves, and how it goes on.

    Args:
        progress: progress of the search, if a candidate has driven all courses.
        out: folder of the search.
        storage: storage of the study, if it is not in the folder.
    """
    from tral_fsm.tuning.search.storage import masked

    if progress is None or not progress.better:
        machine = f"No better machine found yet: {out / MACHINE} is the machine as it was."
    else:
        costs = f"cost {progress.best.cost:.3f}, was {progress.old.cost:.3f}"
        machine = f"{out / MACHINE} is the best machine so far ({costs}), without the check on new courses."
    if storage is not None:
        return f"{machine}\n{masked(storage)} keeps the study: the same command goes on."
    return f"{machine}\n{out / STUDY} keeps the study: the same command with --resume goes on."


def show_parameters(machine: MachineDefinition, *, as_json: bool) -> None:
    """Print the parameters of a machine with their ranges, and which of them a search changes by default.

    Args:
        machine: the machine.
        as_json: print a JSON list instead of a table.
    """
    from rich.console import Console
    from rich.text import Text

    from tral_fsm.tuning.listing import listing
    from tral_fsm.tuning.tables import range_cell, value_cell

    found = listing(machine)
    if as_json:
        typer.echo(json.dumps([_listed_record(each) for each in found], indent=2))
        return
    caption = "* is searched without --params. --params takes a name, a path (--json has it), or a pattern such as *.p."
    table = narrow_table(caption=caption)
    table.add_column("")
    table.add_column("name", overflow="fold", max_width=40)
    for heading in ("value", "unit"):
        table.add_column(heading, justify="right" if heading == "value" else "left", no_wrap=True)
    table.add_column("range")
    names = Counter(each.name for each in found)
    for each in found:
        name = each.name if names[each.name] == 1 else each.path
        ends = "give one: NAME=LOW:HIGH" if each.parameter is None else range_cell(each.parameter)
        table.add_row("*" if each.is_default else "", *map(Text, (name, value_cell(each.value), each.unit, ends)))
    Console().print(table)


def _listed_record(each: Listed) -> dict[str, Any]:
    """A parameter as plain values; `range` holds its ends, or its choices; None: it must be given."""
    known = each.parameter
    ends = None if known is None else list(known.choices) if known.kind == "choice" else [known.low, known.high]
    plain = {"path": each.path, "name": each.name, "type": each.where, "value": each.value, "unit": each.unit}
    return {**plain, "range": ends, "default": each.is_default}


def print_result(tuned: Tuned, out: Path) -> None:
    """Print the parameters that were found, and the result of the check."""
    if tuned.values is not None:
        print_figures(_parameters(tuned))
    if tuned.comparison is not None:
        print_figures(check_table(tuned.comparison))
    typer.echo(tuned.verdict)
    machine = "the tuned machine" if tuned.kept is tuned.new and tuned.values is not None else "the machine as it was"
    typer.echo(f"{out / MACHINE} is {machine}; {out / PAGE} shows more.")


def _parameters(tuned: Tuned) -> Table:
    from rich.text import Text

    from tral_fsm.tuning.tables import before_cell

    table = narrow_table("Parameters")
    table.add_column("parameter", overflow="fold", max_width=50)
    for heading in ("was", "now"):
        table.add_column(heading, justify="right", max_width=13)
    for each, value in zip(tuned.parameters, tuned.values or (), strict=True):
        unit = f" [{each.unit}]" if each.unit else ""
        table.add_row(Text(each.label + unit), before_cell(each), str(value))
    return table


def check_table(comparison: Comparison) -> Table:
    """Table of the check on hold-out courses, each interval below its figure."""
    from rich.text import Text

    from tral_fsm.tuning.tables import CHECK_HEADER, check_rows

    title = f"On {comparison.courses} drives that nothing was tuned on, with 95 % intervals below"
    table = narrow_table(title, _CAPTION)
    for heading in CHECK_HEADER:
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for row in check_rows(comparison):
        # The interval stands below its figure, and what happened to single drives below their share.
        cells = [cell.replace(" (", "\n", 1).rstrip(")").replace(" lost, ", " lost,\n", 1) for cell in row]
        table.add_row(*map(Text, cells), end_section=row[0] in ("collisions", "steering [1/m]"))
    return table
