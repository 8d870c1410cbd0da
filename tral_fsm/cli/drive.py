"""`tral drive`: a policy drives seeded courses; the results are numbers and pictures."""

from __future__ import annotations

import json
from pathlib import Path

import typer

from tral_fsm.cli import drive_options as options
from tral_fsm.cli.console import FAILED, refuse_both
from tral_fsm.programs.drive import DriveArguments, run


def command(
    context: typer.Context,
    scenario: options.Scenario = "office",
    seed: options.Seed = 7,
    episodes: options.Episodes = 1,
    policy: options.Policy = "office",
    camera: options.Camera = "projected",
    randomization: options.Randomized = "default",
    car: options.Car = None,
    out: options.Out = Path("runs/drive"),
    course: options.Course = None,
    video: options.Video = True,
    lens: options.Lens = "default",
    trace: options.Trace = False,
    record: options.Record = False,
    as_json: options.AsJson = False,
) -> None:
    """Let a policy drive.

    The command writes summary.json, trajectory.png and drive.mp4 into the folder; of several episodes each has its
    pictures in a subfolder seed_N. The exit code is 0 if all episodes succeeded, else 1.
    """
    from tral_fsm.cli.show import DriveProgress, table_of_episodes
    from tral_fsm.terminal import print_figures

    refuse_both(context, "scenario", "course")
    arguments = DriveArguments(
        scenario=scenario,
        seed=seed,
        episodes=episodes,
        policy=policy,
        camera=camera,
        randomization=randomization,
        course=course,
        video=video,
        lens=lens,
        trace=trace,
        record=record,
        car=options.car_parameters(car or []),
    )
    try:
        report = run(arguments, out, DriveProgress)
    except KeyboardInterrupt:
        typer.echo(f"Stopped. The episodes that had ended are in {out}", err=True)
        raise
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        print_figures(table_of_episodes(report))
        typer.echo(f"Files: {out}")
    if report["figures"]["successes"] < episodes:
        raise typer.Exit(FAILED)
