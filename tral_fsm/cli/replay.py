"""`tral replay`: a recorded drive again."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from tral_fsm.programs.replay import ReplayArguments, run


class Other(StrEnum):
    """What the recorded commands drive, too."""

    simulation = "simulation"


class To(StrEnum):
    """Formats that a recording is written in."""

    csv = "csv"
    lerobot = "lerobot"
    mcap = "mcap"


def command(
    file: Annotated[Path, typer.Argument(help="A recording, whole or torn.")],
    against: Annotated[
        Other | None, typer.Option(help="Drive the simulated car with the recorded commands, and show the differences.")
    ] = None,
    course: Annotated[
        str | None,
        typer.Option(help="Course on which a real car drove, by name or file; a simulated drive keeps its own."),
    ] = None,
    policy: Annotated[
        str | None, typer.Option(help="Let this policy answer each recorded observation, and show the differences.")
    ] = None,
    video: Annotated[bool, typer.Option("--video", help="Write replay.mp4.")] = False,
    to: Annotated[
        list[To] | None,
        typer.Option(
            help="Write drive.csv, a LeRobotDataset v3 (needs the extra `lerobot`), or a torn file mended. Repeatable."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder of the files.")] = Path("runs/replay"),
    as_json: Annotated[bool, typer.Option("--json", help="Print replay.json and nothing else.")] = False,
) -> None:
    """Show a recorded drive again: its figures, trajectory.png and replay.json, and what the options ask for."""
    from tral_fsm.cli.replay_show import print_replay

    arguments = ReplayArguments(
        file=file,
        against_simulation=against is not None,
        course=course,
        policy=policy,
        video=video,
        to=tuple(one.value for one in to or ()),
    )
    report = run(arguments, out)
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        print_replay(report)
        typer.echo(f"Files: {out}")
