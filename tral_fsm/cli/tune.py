"""`tral tune`: numbers of a machine are searched on many drives, and checked on courses that are new to them."""

from __future__ import annotations

import json
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tral_env.errors import ConfigError
from tral_fsm.cli import opengl
from tral_fsm.cli.console import print_figures, versions
from tral_fsm.cli.drive import Camera, Randomization
from tral_fsm.cli.files import prepare_folder, write_json

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.table import Table

    from tral_fsm.tuning import Progress, Settings, Task, Tuned
    from tral_fsm.tuning.heldout import Comparison, Estimate

Sampler = Literal["cmaes", "tpe", "nsga2", "random"]
Pooling = Literal["mean", "worst", "cvar"]
_KEPT = "What was found is kept; the same command with --resume goes on."


def command(
    policy: Annotated[str, typer.Option(help="Packaged machine, or a file.")] = "wall",
    scenario: Annotated[str, typer.Option(help="Families of courses, with commas.")] = "straight",
    params: Annotated[
        str, typer.Option(help="Which parameters, with commas: state[3].p, follow.p, *.p; =LOW:HIGH gives a range.")
    ] = "*.p,*.d",
    tie: Annotated[bool, typer.Option("--tie", help="All that one pattern names share one value.")] = False,
    budget: Annotated[int, typer.Option(min=1, help="Drives that the search may cost.")] = 3000,
    seeds: Annotated[str, typer.Option(help="FIRST:END of the courses of the search, each family has them.")] = "0:8",
    report_seeds: Annotated[
        str, typer.Option(help="FIRST:END of the courses of the held-out check; none: no check.")
    ] = "500:600",
    randomization: Annotated[Randomization, typer.Option(help="How much cars and sensors differ.")] = "default",
    camera: Annotated[Camera, typer.Option(help="Projected is faster.")] = "projected",
    objective: Annotated[
        Pooling, typer.Option(help="How the costs of drives become one; cvar: worst quarter.")
    ] = "mean",
    objectives: Annotated[
        str, typer.Option(help="For a Pareto front, with --sampler nsga2: clearance,time,steering.")
    ] = "",
    sampler: Annotated[Sampler, typer.Option(help="cmaes; the others are Optuna's (extra `tune`).")] = "cmaes",
    population: Annotated[int | None, typer.Option(min=4, help="Candidates in a generation.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the sampler.")] = 0,
    processes: Annotated[int | None, typer.Option(min=1, help="How many work at once; default: all cores.")] = None,
    storage: Annotated[
        str | None, typer.Option(help="Database URL or journal file: any number of processes on one study.")
    ] = None,
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder of the study, the machine, the report.")] = Path(
        "runs/tune"
    ),
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the study in the folder.")] = False,
    save_as: Annotated[
        Path | None, typer.Option("--save", dir_okay=False, help="Write the machine here too, in the suffix's format.")
    ] = None,
    grid: Annotated[
        int, typer.Option(min=0, max=40, help="Points along a side of the report's plane of cost; 0: no plane.")
    ] = 9,
    classical: Annotated[
        bool, typer.Option("--classical", help="Print classical gains and the margins of the machine's; no search.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Write tune.json to stdout too, and nothing else.")] = False,
) -> None:
    """Search numbers of a machine, and check them on courses that are new to them.

    Writes machine.json, tune.json, report.html and study.jsonl into the folder. Ctrl-C keeps what was found; --resume
    goes on.
    """
    from tral_fsm.cli.classical import print_classical
    from tral_fsm.library import load as load_machine
    from tral_fsm.report.tuning_page import Page, save_report
    from tral_fsm.tuning import Objective, Settings, Task, check_apart, find, save, tune

    task = Task(
        scenarios=tuple(_listed(scenario)), seeds=_seeds(seeds, "--seeds"), randomization=randomization, camera=camera
    )
    settings = Settings(
        budget=budget,
        sampler=sampler,
        objectives=tuple(_listed(objectives)),
        population=population,
        report_seeds=() if report_seeds == "none" else _seeds(report_seeds, "--report-seeds"),
        seed=seed,
    )
    machine = load_machine(policy)
    if classical:
        print_classical(machine)
        return
    check_apart(task, settings)
    find(machine, _listed(params), tie=tie)  # what cannot be used is said before anything is written
    if camera == "rendered":
        opengl.require_loadable()
    pooled = Objective(pooling=objective)
    prepare_folder(out)
    _check_suffix(save_as)
    origin = _origin()
    with _Bar(budget) as bar:
        try:
            tuned = tune(
                machine, _listed(params), task, objective=pooled, settings=settings, tie=tie,
                processes=processes, out=out, resume=resume, storage=storage, origin=origin, on_progress=bar,
            )  # fmt: skip
        except KeyboardInterrupt:
            bar.stop()
            typer.echo(_KEPT, err=True)
            raise
    report = _report(tuned, task, settings, policy, origin)
    write_json(out / "tune.json", report)
    if save_as is not None:
        save(tuned, save_as, origin)
    page = Page(tuned=tuned, task=task, objective=pooled, command=origin, version=report["versions"]["tral-env"])
    save_report(page, out / "report.html", processes=processes or os.cpu_count() or 1, size=grid)
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        _show(tuned, out)


def _listed(text: str) -> list[str]:
    """Names with commas between them."""
    return [name.strip() for name in text.split(",") if name.strip()]


def _seeds(text: str, option: str) -> tuple[int, ...]:
    first, _, end = text.partition(":")
    try:
        seeds = range(int(first), int(end))
    except ValueError:
        raise ConfigError(f"{option} {text}: expected FIRST:END, such as 0:8") from None
    if not seeds or seeds[0] < 0:
        raise ConfigError(f"{option} {text}: expected FIRST below END, neither below 0")
    return tuple(seeds)


def _check_suffix(path: Path | None) -> None:
    """What cannot be written is said before an hour of driving."""
    from tral_fsm.formats import by_suffix

    if path is not None:
        by_suffix(path.suffix)
        prepare_folder(path.parent)


def _origin() -> str:
    """The command, as files tell it: without the password of a database."""
    from tral_fsm.tuning.storage import masked

    arguments = sys.argv[1:]
    return (
        " ".join(["tral", *(shlex.quote(masked(each)) for each in arguments)])
        if arguments[:1] == ["tune"]
        else "tral tune"
    )


class _Bar:
    """Progress on stderr, with the best so far."""

    def __init__(self, budget: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.completed:.0f}/{task.total:.0f} drives"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
        )
        self._task = self._bar.add_task("tune", total=budget)

    def __enter__(self) -> _Bar:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Leave the terminal to others."""
        self._bar.stop()

    def __call__(self, progress: Progress) -> None:
        """Show where the search is."""
        said = f"cost {progress.best.cost:.3f} (was {progress.old.cost:.3f})"
        if progress.drives >= progress.budget:
            said += ", checking"
        self._bar.update(self._task, completed=min(progress.drives, progress.budget), description=said)


def _report(tuned: Tuned, task: Task, settings: Settings, policy: str, origin: str) -> dict[str, Any]:
    from dataclasses import asdict

    asked = {"policy": policy, "task": task.record(), "settings": json.loads(json.dumps(asdict(settings)))}
    return {"command": origin, **asked, "versions": versions(), **tuned.record()}


def _show(tuned: Tuned, out: Path) -> None:
    if tuned.values is None:
        typer.echo("Nothing better than the machine as it was has been found.")
    else:
        print_figures(_parameters(tuned))
    if tuned.comparison is not None:
        print_figures(_held_out(tuned.comparison))
        typer.echo(tuned.comparison.verdict)
    typer.echo(f"Files: {out}")


def _parameters(tuned: Tuned) -> Table:
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text("Parameters"), title_justify="left")
    for heading in ("parameter", "was", "now"):
        table.add_column(heading, justify="left" if heading == "parameter" else "right")
    for each, value in zip(tuned.parameters, tuned.values or (), strict=True):
        unit = f" [{each.unit}]" if each.unit else ""
        table.add_row(
            Text(each.label + unit),
            f"{each.start:.4g}" if isinstance(each.start, float) else str(each.start),
            str(value),
        )
    return table


def _held_out(comparison: Comparison) -> Table:
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text("On courses that nothing was tuned on, with 95 % intervals"), title_justify="left")
    for heading in ("", "was", "now", "difference"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    old, new = comparison.old, comparison.new
    split = f"{comparison.only_new} gained, {comparison.only_old} lost"
    table.add_row("success", _percent(old.success), _percent(new.success), split)
    rows: Mapping[str, tuple[Estimate, Estimate, Estimate, float]] = {
        "clearance RMSE [cm]": (old.clearance_rmse_m, new.clearance_rmse_m, comparison.clearance_m, 100.0),
        "time [s/m]": (old.time_per_m, new.time_per_m, comparison.time_per_m, 1.0),
        "cost": (old.cost, new.cost, comparison.cost, 1.0),
    }
    for name, (was, now, difference, scale) in rows.items():
        table.add_row(Text(name), _estimate(was, scale), _estimate(now, scale), _estimate(difference, scale, "+"))
    return table


def _percent(estimate: Estimate) -> str:
    return _estimate(estimate, 100.0, digits=0) + " %"


def _estimate(estimate: Estimate, scale: float, sign: str = "", digits: int = 2) -> str:
    if estimate.value is None:
        return "-"
    text = f"{scale * estimate.value:{sign}.{digits}f}"
    if estimate.low is None or estimate.high is None:
        return text
    return f"{text} ({scale * estimate.low:{sign}.{digits}f} to {scale * estimate.high:{sign}.{digits}f})"
