"""`tral compare`: policies of any kind drive the same courses; the result is a page with intervals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from tral_fsm.cli.console import refuse_both
from tral_fsm.programs.compare import PAGE, run, without_paths
from tral_fsm.terminal import print_figures


def command(
    context: typer.Context,
    policies: Annotated[
        str,
        typer.Option(
            help="Contenders, separated by commas: packaged machines, machine files, policy files, FILE.py:NAME, or "
            "the built-in constant, random, pursuit and ramp. NAME=A+B makes one contender of agents that were trained "
            "with different seeds."
        ),
    ] = "office,pursuit,constant,random",
    suite: Annotated[str, typer.Option(help="Courses: smoke, corners or standard.")] = "smoke",
    courses: Annotated[
        int | None, typer.Option(min=1, help="Courses of each family and level, if not those of the suite.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the bootstrap; it changes no drive.")] = 0,
    processes: Annotated[int, typer.Option(min=1, help="Processes that drive.")] = 1,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers drive; needs the extra `cluster`."),
    ] = None,
    videos: Annotated[
        int, typer.Option(min=0, help="Short videos of so many failures on the page, which need OpenGL.")
    ] = 0,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the files; a comparison that lies there goes on.")
    ] = Path("runs/compare"),
    as_json: Annotated[bool, typer.Option("--json", help="Print compare.json and nothing else.")] = False,
) -> None:
    """Compare policies on a suite of courses.

    The command writes compare.html, compare.md and compare.json, and each drive into records.jsonl as it ends. Started
    again, it goes on where it stopped. Other policies or more courses can be added later.
    """
    refuse_both(context, "processes", "cluster")
    try:
        shown = run(policies, suite, out, courses=courses, seed=seed, processes=cluster or processes, videos=videos)
    except KeyboardInterrupt:
        typer.echo(f"Stopped. The drives that have ended are in {out}; the same command goes on.", err=True)
        raise
    if as_json:
        typer.echo(json.dumps(without_paths(shown), indent=2, allow_nan=False))
        return
    from tral_fsm.report.compare.table import table

    print_figures(table(shown))
    typer.echo(f"Page: {out / PAGE}")
