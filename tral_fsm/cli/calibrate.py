"""`tral calibrate`: the lens of a real camera from images of a printed board, or that of the simulated camera."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from tral_env.errors import CalibrationError
from tral_fsm.cli import board_options
from tral_fsm.cli import calibrate_options as options
from tral_fsm.cli.console import FAILED
from tral_fsm.programs.calibrate import GOOD, POOR, CalibrateArguments, run

if TYPE_CHECKING:
    from tral_env.calibration.views import Collection
    from tral_fsm.cli.calibrate_show import LiveCoverage


def command(
    sources: options.Sources = None,
    simulated: options.Simulated = False,
    lens: options.Lens = "wide",
    shots: options.Shots = 40,
    seed: options.Seed = 0,
    board: board_options.Kind = "charuco",
    columns: board_options.Columns = None,
    rows: board_options.Rows = None,
    square_mm: board_options.SquareMm = None,
    marker_mm: board_options.MarkerMm = None,
    dictionary: board_options.Dictionary = "5X5_50",
    legacy: board_options.Legacy = False,
    every: options.Every = 5,
    max_views: options.MaxViews = 60,
    radial: options.Radial = 2,
    name: options.Name = "camera",
    keep_images: options.KeepImages = False,
    out: options.Out = Path("runs/calibrate"),
    as_json: options.AsJson = False,
) -> None:
    """Find the lens of a camera.

    The command writes camera_info.yaml, calibration.json and coverage.png. Every --lens reads camera_info.yaml; a poor
    calibration goes to poor_camera_info.yaml instead. The exit code is 0 for a good calibration, else 1.
    """
    from tral_env.calibration.boards import printed_board
    from tral_env.calibration.solve import TooFewViewsError
    from tral_fsm.cli.calibrate_show import LiveCoverage, print_calibration

    arguments = CalibrateArguments(
        sources=tuple(sources or ()),
        simulated=simulated,
        lens=lens,
        shots=shots,
        seed=seed,
        every=every,
        max_views=max_views,
        radial=radial,
        name=name,
        keep_images=keep_images,
    )
    made = printed_board(board, columns, rows, square_mm, marker_mm, dictionary, legacy)

    def progress(collection: Collection, total: int | None) -> LiveCoverage:
        return LiveCoverage(collection, total, live=arguments.live, quiet=as_json)

    try:
        lens_found, truth, report = run(arguments, made, out, progress)
    except TooFewViewsError as error:
        if error.hint is None:
            raise
        raise CalibrationError(f"{error.told} Hint: {board_options.hint_as_options(error.hint)}") from error
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    else:
        print_calibration(lens_found, truth)
        typer.echo(f"Files: {out}/{GOOD if lens_found.good else POOR}, calibration.json, coverage.png")
    if report["verdict"] == "poor":
        raise typer.Exit(FAILED)
