"""`tral train`: a network learns to drive; the result is a policy file and a curve."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from tral_env.perception import opengl
from tral_fsm.cli.together import taking
from tral_fsm.cli.train_options import TrainOptions
from tral_fsm.cli.train_show import TrainBar
from tral_fsm.evaluation.choices import families
from tral_fsm.evaluation.files import write_figure

if TYPE_CHECKING:
    from tral_fsm.learning.choices import TrainRequest
    from tral_fsm.learning.run import TrainingRun

DEFAULT_MINUTES = 10.0


@taking(TrainOptions)
def command(context: typer.Context, given: TrainOptions) -> None:
    """Train a policy.

    The command writes policy.json and policy.safetensors, the network that drove best on validation courses, and
    curve.json, curve.png and what --resume needs. `tral drive --policy FOLDER` drives it.
    """
    opengl.require_loadable()
    request = _request(given)
    folder = given.out or Path("runs") / f"{given.algo}_{'_'.join(request.scenarios)}_{given.seed}"
    run = train(request, folder, given.settings, resume=given.resume)
    if given.as_json:
        typer.echo(json.dumps(run.curve.points, indent=2))
    elif run.best is None:
        typer.echo(f"Stopped before the first validation: no policy in {folder}.")
    else:
        typer.echo(
            f"Best: {run.best.successes} of {run.best.episodes} drives of the validation arrived, after "
            f"{run.curve.seconds / 60:.1f} min.\n"
            f"Drive it: tral drive --policy {folder} --scenario {request.scenarios[0]}"
        )


def _request(given: TrainOptions) -> TrainRequest:
    """What is asked for of a training."""
    from tral_fsm.learning.choices import TrainRequest

    return TrainRequest(
        algo=given.algo,
        scenarios=tuple(families(given.scenario)),
        minutes=DEFAULT_MINUTES if given.minutes is None and given.steps is None else given.minutes,
        steps=given.steps,
        seed=given.seed,
        randomization=given.randomization,
        machine=given.machine,
        validation=given.validation,
        start=None if given.start is None else str(given.start),
        plain=given.plain,
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
