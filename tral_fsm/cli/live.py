"""`tral live`: the car in the browser, at work, with sliders for the numbers of its machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tral_env.errors import ConfigError
from tral_fsm.cli import drive_options as options
from tral_fsm.cli.console import refuse_both

_DRIVES = ("policy", "beside", "scenario", "course", "seed", "randomization", "camera")
"""Options of a drive, which a recording and a twin do not have."""


def command(
    context: typer.Context,
    policy: options.Policy = "office",
    beside: Annotated[list[str] | None, typer.Option(help="Another policy on the same course. Repeatable.")] = None,
    scenario: options.Scenario = "office",
    course: options.Course = None,
    seed: Annotated[int, typer.Option(min=0, help="Draws course, car and noise.")] = 7,
    randomization: options.Randomized = "default",
    camera: options.Camera = "projected",
    replay: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Show a recording instead, see `tral drive --record`.")
    ] = None,
    twin: Annotated[str | None, typer.Option(metavar="NAME", help="Show a running twin instead.")] = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on. One that other computers reach needs the token in the link.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; if it is taken, the next free one.")] = 8080,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="The program ends by itself after so long.")] = None,
) -> None:
    """Watch a drive in the browser, and turn the numbers of its machine while it drives.

    A page shows the car in its corridor, its machine with the active state, and what it measures. --replay shows a
    recorded drive, --twin a running twin: both can only be watched.
    """
    from tral_fsm.programs import live

    refuse_both(context, "scenario", "course")
    arguments = live.LiveArguments(host=host, port=port, seconds=seconds)
    if replay is not None or twin is not None:
        _refuse_drive(context, "replay" if replay is not None else "twin")
    if replay is not None:
        live.replay(arguments, replay, _tell)
    elif twin is not None:
        live.twin(arguments, twin, _tell)
    else:
        told = {"scenario": scenario, "course": course, "seed": seed, "randomization": randomization, "camera": camera}
        live.drive(arguments, told, [policy, *(beside or [])], _tell)


def _refuse_drive(context: typer.Context, shown: str) -> None:
    """Refuse options of a drive beside something that is only watched.

    Raises:
        ConfigError: one was given.
    """
    others = [*_DRIVES, *({"replay", "twin"} - {shown})]
    for name in others:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            raise ConfigError(f"--{shown} only shows what is there already: expected no --{name}")


def _tell(url: str) -> None:
    typer.echo(f"Open {url} in a browser. Ctrl-C ends it.")
