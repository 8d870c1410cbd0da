"""`tral live`: the car in the browser, at work, with sliders for the numbers of its machine."""

from __future__ import annotations

from typing import Annotated

import typer

from tral_fsm.cli import drive_options as options
from tral_fsm.cli.console import refuse_both


def command(
    context: typer.Context,
    policy: options.Policy = "office",
    beside: Annotated[list[str] | None, typer.Option(help="Another policy on the same course. Repeatable.")] = None,
    scenario: options.Scenario = "office",
    course: options.Course = None,
    seed: Annotated[int, typer.Option(min=0, help="Draws course, car and noise.")] = 7,
    randomization: options.Randomized = "default",
    camera: options.Camera = "projected",
    host: Annotated[
        str, typer.Option(help="Address to listen on; another one than this needs the token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; a taken one gives the next free one.")] = 8080,
    seconds: Annotated[float | None, typer.Option(help="The program ends by itself after so long.")] = None,
) -> None:
    """Watch a drive in the browser, and turn the numbers of its machine while it drives."""
    from tral_fsm.programs.live import LiveArguments, drive

    refuse_both(context, "scenario", "course")
    told = {"scenario": scenario, "course": course, "seed": seed, "randomization": randomization, "camera": camera}
    arguments = LiveArguments(host=host, port=port, seconds=seconds)
    drive(arguments, told, [policy, *(beside or [])], _tell)


def _tell(url: str) -> None:
    typer.echo(f"Open {url} in a browser; Ctrl-C ends the drive.")
