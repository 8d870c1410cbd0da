"""Options of `tral train`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer


@dataclass(frozen=True, kw_only=True)
class TrainOptions:
    """What stands on the command line of `tral train`, in the order of its help."""

    algo: Annotated[
        str,
        typer.Option(
            help="teacher: learn from a machine. ppo, sac: learn from the reward. residual: learn to correct a machine."
        ),
    ] = "teacher"
    scenario: Annotated[str, typer.Option(help="Families of courses, separated by commas, or all.")] = "corners"
    minutes: Annotated[
        float | None, typer.Option(help="Time for the training, min; 10 if neither it nor --steps is given.")
    ] = None
    steps: Annotated[int | None, typer.Option(help="Decisions of all cars together, instead of a time.")] = None
    seed: Annotated[int, typer.Option(min=0, help="Seed of the network and of its courses.")] = 0
    randomization: Annotated[
        str,
        typer.Option(
            help="How much cars and sensors differ: none, default, hard, or a file of ranges; several, separated by "
            "commas."
        ),
    ] = "default"
    machine: Annotated[
        str | None,
        typer.Option(
            help="Machine that teaches or is corrected: a packaged one or a file. Default: that of the family."
        ),
    ] = None
    settings: Annotated[
        Path | None, typer.Option(dir_okay=False, help="YAML file of hyper-parameters that replace packaged ones.")
    ] = None
    validation: Annotated[int, typer.Option(min=1, help="Episodes of a validation.")] = 50
    plain: Annotated[
        bool,
        typer.Option(
            "--plain", help="With --algo teacher: a student that sees the readings alone, as --from wants it."
        ),
    ] = False
    start: Annotated[
        Path | None, typer.Option("--from", help="With --algo ppo: folder of a policy from which the training goes on.")
    ] = None
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of the files; default: runs/ALGO_SCENARIO_SEED.")
    ] = None
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the training in the folder.")] = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the curve and nothing else.")] = False
