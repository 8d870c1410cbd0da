"""`tral live`: the car in the browser, at work, with sliders for the numbers of its machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tral_env.errors import ConfigError
from tral_fsm.cli import deploy
from tral_fsm.cli import drive_options as options
from tral_fsm.cli.console import refuse_both
from tral_fsm.programs.deploy import DeployArguments

_COURSE = ("beside", "scenario", "course", "seed", "randomization", "camera")
"""Options of a simulated drive, which nothing else has."""
_DRIVES = ("policy", *_COURSE)
"""Options of a drive, which a recording and a twin do not have."""
_WATCHED = ("replay", "twin", "car")
"""What is shown instead of a simulated drive."""
_CAR_S = 60.0
"""A drive of the car ends after so long, as that of `tral deploy`, unless --seconds says otherwise."""


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
    car: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="Drive the real car of this car file: `tral deploy --view`, armed at the terminal."
        ),
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on. One that other computers reach needs the token in the link.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; if it is taken, the next free one.")] = 8080,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="The program ends by itself after so long, s.")] = None,
) -> None:
    """Watch a drive in the browser, and turn the numbers of its machine while it drives.

    A page shows the car in its corridor, its machine with the active state, and what it measures. --replay shows a
    recorded drive, --twin a running twin: both can only be watched. --car is another door to `tral deploy --view`:
    the policy drives the real car once a person at this terminal presses r; any other key stops it, and so does the
    one button of the page.
    """
    from tral_fsm.programs import live

    refuse_both(context, "scenario", "course")
    arguments = live.LiveArguments(host=host, port=port, seconds=seconds)
    shown = [name for name in _WATCHED if context.params[name] is not None]
    if shown:
        _refuse_drive(context, shown[0])
    if car is not None:
        told_s = _CAR_S if seconds is None else seconds
        deploy.drive(
            DeployArguments(policy=policy, config=car, view=True, host=host, port=port, max_duration_s=told_s),
            Path("runs/deploy"),
        )
    elif replay is not None:
        live.replay(arguments, replay, _tell)
    elif twin is not None:
        live.twin(arguments, twin, _tell)
    else:
        told = {"scenario": scenario, "course": course, "seed": seed, "randomization": randomization, "camera": camera}
        live.drive(arguments, told, [policy, *(beside or [])], _tell, lambda line: typer.echo(line, err=True))


def _refuse_drive(context: typer.Context, shown: str) -> None:
    """Refuse options that mean nothing beside what is shown.

    Raises:
        ConfigError: one was given.
    """
    others = [*(_COURSE if shown == "car" else _DRIVES), *(name for name in _WATCHED if name != shown)]
    for name in others:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            takes = "drives a real car" if shown == "car" else "only shows what is there already"
            raise ConfigError(f"--{shown} {takes}: expected no --{name}")


def _tell(url: str) -> None:
    typer.echo(f"Open {url} in a browser. Ctrl-C ends it.")
