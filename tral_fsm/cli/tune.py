"""`tral tune`: a sweep over the gains of a machine's wall-following states."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tral_env.errors import ConfigError
from tral_fsm.cli.console import check_name, print_figures, versions
from tral_fsm.cli.drive import Randomization
from tral_fsm.cli.files import prepare_folder, write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rich.table import Table

    from tral_fsm.definition import MachineDefinition
    from tral_fsm.tune import Cell, Task


def command(
    policy: Annotated[str, typer.Option(help="Packaged machine, or a JSON file.")] = "wall",
    scenario: Annotated[str, typer.Option(help="Family of courses.")] = "straight",
    grid: Annotated[int, typer.Option(min=2, max=20, help="Values of each gain.")] = 5,
    episodes: Annotated[int, typer.Option(min=1, help="Courses a pair of gains is tried on.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first course.")] = 0,
    p: Annotated[str | None, typer.Option(help="LOW:HIGH; without it a quarter to four times the machine's.")] = None,
    d: Annotated[str | None, typer.Option(help="LOW:HIGH; the same.")] = None,
    randomization: Annotated[Randomization, typer.Option(help="How much cars and sensors differ.")] = "default",
    processes: Annotated[int, typer.Option(min=1, help="How many work at once.")] = 2,
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder of sweep.json and sweep.png.")] = Path("runs/tune"),
    as_json: Annotated[bool, typer.Option("--json", help="Write sweep.json to stdout too, and nothing else.")] = False,
) -> None:
    """Sweep p and d of a machine's wall-following states, on the same courses for every pair.

    Prints and draws the clearance error. The best pair has the smallest error among those with the most successes.
    """
    from tral_env.course.generate import SCENARIOS
    from tral_fsm.library import load as load_machine
    from tral_fsm.tune import Task, best, gains, with_gains

    check_name("scenario", scenario, SCENARIOS)
    machine = load_machine(policy)
    own = dict(zip("pd", gains(machine), strict=True))
    values = {name: _values(span, own[name], grid, name) for name, span in (("p", p), ("d", d))}
    for end in (0, -1):  # what cannot be used is said before an hour of driving
        with_gains(machine, values["p"][end], values["d"][end])
    prepare_folder(out)
    task = Task(scenario=scenario, seeds=tuple(range(seed, seed + episodes)), randomization=randomization)
    report = {"complete": False, "policy": policy, "task": asdict(task), "versions": versions(), "gains": own}
    cells: list[Cell] = []

    def keep(cell: Cell) -> None:
        cells.append(cell)
        report.update(
            best=best(cells).record(), cells=[cell.record() for cell in cells], complete=len(cells) == grid**2
        )
        write_json(out / "sweep.json", report)

    _sweep(machine, values, task, processes, keep)
    _draw(report, cells, out)
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        _show(report, cells, out)


def _values(span: str | None, base: float, count: int, name: str) -> list[float]:
    """Values of a gain: as spanned, else from a quarter of the machine's own to four times it."""
    import numpy as np

    if span is None:
        if base <= 0:
            raise ConfigError(f"the machine has {name} = {base:g}, so the range must be given: --{name} LOW:HIGH")
        return [float(value) for value in base * np.geomspace(0.25, 4.0, count)]
    low, _, high = span.partition(":")
    try:
        ends = float(low), float(high)
    except ValueError:
        raise ConfigError(f"--{name} {span}: expected LOW:HIGH, such as 0.5:8") from None
    if not np.isfinite(ends).all():
        raise ConfigError(f"--{name} {span}: expected finite numbers, such as 0.5:8")
    if not ends[0] < ends[1]:
        raise ConfigError(f"--{name} {span}: expected the lower end first")
    return [float(value) for value in np.linspace(*ends, count)]


def _sweep(
    machine: MachineDefinition,
    values: Mapping[str, Sequence[float]],
    task: Task,
    processes: int,
    on_cell: Callable[[Cell], None],
) -> None:
    from rich.console import Console
    from rich.progress import Progress

    from tral_fsm.tune import sweep

    p, d = values["p"], values["d"]
    with Progress(console=Console(stderr=True)) as bar:
        bar_task = bar.add_task(f"{len(p)} x {len(d)} gains", total=len(p) * len(d))

        def done(cell: Cell) -> None:
            on_cell(cell)
            bar.advance(bar_task)

        sweep(machine, p, d, task, processes=processes, on_cell=done)


def _draw(report: Mapping[str, Any], cells: Sequence[Cell], out: Path) -> None:
    from tral_fsm.report.heatmap import sweep_figure

    task = report["task"]
    courses = len(task["seeds"])
    title = f"{report['policy']} on {task['scenario']}, {courses} course{'s' * (courses > 1)}, {task['randomization']}"
    sweep_figure(cells, title).savefig(out / "sweep.png", dpi=120)


def _show(report: Mapping[str, Any], cells: Sequence[Cell], out: Path) -> None:
    print_figures(_table(cells))
    chosen, own = report["best"], report["gains"]
    typer.echo(
        f"Best: p = {chosen['p']:.4g}, d = {chosen['d']:.4g}; the machine has p = {own['p']:g}, d = {own['d']:g}"
    )
    typer.echo(f"Files: {out}")


def _table(cells: Sequence[Cell]) -> Table:
    from rich.table import Table
    from rich.text import Text

    from tral_fsm.report.heatmap import label

    table = Table("p \\ d", title=Text("Clearance RMSE [cm]"), title_justify="left")
    for value in sorted({cell.d for cell in cells}):
        table.add_column(f"{value:.3g}", justify="right")
    for value in sorted({cell.p for cell in cells}):
        row = sorted((cell for cell in cells if cell.p == value), key=lambda cell: cell.d)
        table.add_row(f"{value:.3g}", *(label(cell).replace("\n", ", ") for cell in row))
    return table
