"""`tral bench`: how fast the simulation is on this computer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from tral_fsm.evaluation.choices import check_families
from tral_fsm.evaluation.files import prepare_folder, write_figure, write_json
from tral_fsm.terminal import print_figures

app = typer.Typer(no_args_is_help=True, help="Measure how fast the simulation is on this computer.")


@app.callback()
def main() -> None:
    """Measure how fast the simulation is on this computer."""


@app.command("speed")
def speed(
    quick: Annotated[bool, typer.Option(help="Measure fewer contestants, in less than a minute.")] = False,
    scenario: Annotated[str, typer.Option(help="Family of the courses.")] = "corners",
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of speed.json and speed.png; without it no files.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Measure steps per second: single and vector environments beside bare MuJoCo and those of Gymnasium."""
    from dataclasses import replace

    from rich.console import Console

    from tral_fsm.bench.plan import QUICK, SpeedPlan
    from tral_fsm.bench.speed import measure

    check_families([scenario])
    if out is not None:
        prepare_folder(out)
    plan = replace(QUICK if quick else SpeedPlan(), scenario=scenario)
    with Console(stderr=True).status("measuring") as status:
        result = measure(plan, on_round=lambda name: status.update(f"measuring {name}"))
    if out is not None:
        _save(result, out)
    if as_json:
        typer.echo(json.dumps(result, indent=2))
    else:
        _show(result, out)


def _save(result: dict[str, Any], out: Path) -> None:
    from tral_fsm.bench.plot import speed_figure

    write_json(out / "speed.json", result)
    write_figure(out / "speed.png", speed_figure(result), 120)


def _show(result: dict[str, Any], out: Path | None) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("", no_wrap=True)
    for heading in ("steps/s", "simulated s\nper wall s", "simulated s\nper CPU s"):
        table.add_column(heading, justify="right")
    for row in result["contestants"]:
        figures = (row["steps_per_s"], row["sim_s_per_wall_s"], row["sim_s_per_cpu_s"])
        table.add_row(row["name"], *("-" if figure is None else f"{figure:,.0f}" for figure in figures))
    print_figures(table)
    console = Console()
    for name, value in result["ratios"].items():
        console.print(f"{name.replace('_', ' ')}: {value:.2f}")
    console.print(
        f"reset of a row, family {result['reset_scenario']}: {result['reset_ms_per_row']:.2f} ms with a new course, "
        f"{result['reset_ms_per_row_kept']:.2f} ms with one that was kept (courses=N)"
    )
    console.print(_shares(result["shares"]))
    startup = result["startup"]
    console.print(
        f"import {startup['import_s']:.2f} s, make and first reset {startup['make_and_reset_s']:.2f} s, "
        f"memory {startup['memory_mb_per_row']:.2f} MB a row"
    )
    if result["camera"] is not None:
        console.print(
            "rendered camera: " + ", ".join(f"{k.replace('_', ' ')} {v:.1f}" for k, v in result["camera"].items())
        )
    for row in result["course_size"] or ():
        console.print(f"{row['boxes']} boxes: {row['step_us']:.0f} us a step, bare {row['bare_us']:.0f} us")
    for skipped in result["skipped"]:
        console.print(f"not measured: {skipped['name']}: {skipped['reason']}", markup=False)
    if out is not None:
        console.print(f"Files: {out}")


def _shares(shares: dict[str, Any]) -> str:
    speeds = ", ".join(f"{cores}: {speed:,.0f}" for cores, speed in shares["extrapolated_steps_per_s"].items())
    return (
        f"step of a row of {shares['rows']}: {shares['physics_us']:.1f} us of physics, which threads divide, and "
        f"{shares['serial_us']:.1f} us, which they do not. Steps per second by cores, extrapolated, not measured: "
        f"{speeds}"
    )
