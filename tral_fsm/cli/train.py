"""`tral train`: a network learns to drive; the result is a policy file and a curve."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tral_env.perception import opengl
from tral_fsm.cli.train_show import TrainBar
from tral_fsm.evaluation.choices import families
from tral_fsm.evaluation.files import write_figure

if TYPE_CHECKING:
    from tral_fsm.learning.choices import TrainRequest
    from tral_fsm.learning.run import TrainingRun

DEFAULT_MINUTES = 10.0


def command(
    algo: Annotated[
        str,
        typer.Option(
            help="teacher: learn from a machine. ppo, sac: learn from the reward. residual: learn to correct a machine."
        ),
    ] = "teacher",
    scenario: Annotated[str, typer.Option(help="Families of courses, separated by commas, or all.")] = "corners",
    minutes: Annotated[
        float | None, typer.Option(help="Time for the training, min; 10 if neither it nor --steps is given.")
    ] = None,
    steps: Annotated[int | None, typer.Option(help="Decisions of all cars together, instead of a time.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the network and of its courses.")] = 0,
    randomization: Annotated[
        str, typer.Option(help="How much cars and sensors differ: none, default, hard, or a file of ranges.")
    ] = "default",
    machine: Annotated[
        str | None,
        typer.Option(
            help="Machine that teaches or is corrected: a packaged one or a file. Default: that of the family."
        ),
    ] = None,
    settings: Annotated[
        Path | None, typer.Option(dir_okay=False, help="YAML file of hyper-parameters that replace packaged ones.")
    ] = None,
    validation: Annotated[int, typer.Option(min=1, help="Episodes of a validation.")] = 50,
    start: Annotated[
        Path | None, typer.Option("--from", help="With --algo ppo: folder of a policy from which the training goes on.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of the files; default: runs/ALGO_SCENARIO_SEED.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the training in the folder.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the curve and nothing else.")] = False,
) -> None:
    """Train a policy.

    The command writes policy.json and policy.safetensors, the network that drove best on validation courses, and
    curve.json, curve.png and what --resume needs. `tral drive --policy FOLDER` drives it.
    """
    from tral_fsm.learning.choices import TrainRequest

    opengl.require_loadable()
    request = TrainRequest(
        algo=algo,
        scenarios=tuple(families(scenario)),
        minutes=DEFAULT_MINUTES if minutes is None and steps is None else minutes,
        steps=steps,
        seed=seed,
        randomization=randomization,
        machine=machine,
        validation=validation,
        start=None if start is None else str(start),
    )
    folder = out or Path("runs") / f"{algo}_{'_'.join(request.scenarios)}_{seed}"
    run = train(request, folder, settings, resume=resume)
    if as_json:
        typer.echo(json.dumps(run.curve.points, indent=2))
    elif run.best is None:
        typer.echo(f"Stopped before the first validation: no policy in {folder}.")
    else:
        typer.echo(
            f"Best: {run.best.successes} of {run.best.episodes} drives of the validation arrived, after "
            f"{run.curve.seconds / 60:.1f} min.\n"
            f"Drive it: tral drive --policy {folder} --scenario {request.scenarios[0]}"
        )


def train(request: TrainRequest, folder: Path, settings: Path | None, *, resume: bool) -> TrainingRun:
    """Train, and write all files.

    Args:
        request: what is asked for.
        folder: folder of the files.
        settings: YAML file of hyper-parameters; None: those of the package.
        resume: go on with the training in the folder.

    Raises:
        ConfigError: an option cannot be used.
        MissingExtraError: torch or Stable-Baselines3 is not installed.
    """
    from tral_fsm.learning import algorithms
    from tral_fsm.learning.run import PICTURE, TrainingRun

    algorithm = algorithms.find(request.algo)
    values: Any = algorithm.settings(request, settings)
    with (
        TrainBar(request) as bar,
        TrainingRun(request, values, folder, resume=resume, on_progress=bar.show) as run,
    ):
        bar.begin()
        try:
            algorithm.train(run)
        except KeyboardInterrupt:
            bar.note("Stopped. What was learned until the last validation is kept; --resume goes on.")
    if run.curve.points:
        from tral_fsm.report.learning import learning_curve

        if run.aside is not None:
            bar.note(f"{folder} held an earlier training: its files are now in {run.aside}.")
        title = f"{request.algo}, {', '.join(request.scenarios)}, {request.randomization}"
        write_figure(folder / PICTURE, learning_curve(run.curve.points, title), 120)
    return run
