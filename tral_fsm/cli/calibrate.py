"""`tral calibrate`: the lens of a real camera from images of a printed board, or that of the simulated camera."""

from __future__ import annotations

import contextlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tral_env.errors import CalibrationError, ConfigError
from tral_fsm.cli import board_options
from tral_fsm.cli.console import FAILED
from tral_fsm.evaluation.files import prepare_folder, write_figure, write_json
from tral_fsm.evaluation.host import versions

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from tral_env.calibration.boards import Board
    from tral_env.calibration.solve import Calibration
    from tral_env.calibration.views import Collection
    from tral_env.config import CameraConfig

    Frames = Iterator[tuple[str, "NDArray[np.uint8] | None"]]


GOOD, POOR = "camera_info.yaml", "poor_camera_info.yaml"
"""Files of a good and of a poor calibration: a poor one never replaces a good one."""


@dataclass(frozen=True, kw_only=True)
class CalibrateArguments:
    """Options of `tral calibrate` but for the board and the folder, as the file of the calibration tells them."""

    sources: tuple[str, ...]
    simulated: bool
    lens: str
    shots: int
    seed: int
    every: int
    max_views: int
    radial: int
    name: str
    keep_images: bool


def make_board(
    kind: board_options.BoardKind,
    columns: int | None,
    rows: int | None,
    square_mm: float | None,
    marker_mm: float | None,
    dictionary: str,
    legacy: bool,
) -> Board:
    """The board that the options describe; an option that is None is that of `tral print board`.

    Raises:
        ConfigError: the options describe no board.
    """
    from tral_env.calibration.boards import printed_board

    return printed_board(kind, columns, rows, square_mm, marker_mm, dictionary, legacy)


def command(
    sources: Annotated[
        list[str] | None,
        typer.Argument(help="Images, folders, patterns, videos, or a camera such as /dev/video0.", show_default=False),
    ] = None,
    simulated: Annotated[
        bool, typer.Option("--simulated", help="Look at a board that moves before the simulated camera.")
    ] = False,
    lens: Annotated[
        str, typer.Option(help="Lens of the simulated camera: default, wide, or a camera_info file.")
    ] = "wide",
    shots: Annotated[int, typer.Option(min=1, help="Number of images of the simulated camera.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the simulated board's poses.")] = 0,
    board: board_options.Kind = "charuco",
    columns: board_options.Columns = None,
    rows: board_options.Rows = None,
    square_mm: board_options.SquareMm = None,
    marker_mm: board_options.MarkerMm = None,
    dictionary: board_options.Dictionary = "5X5_50",
    legacy: board_options.Legacy = False,
    every: Annotated[int, typer.Option(min=1, help="Of a video or a camera, look at one in this many frames.")] = 5,
    max_views: Annotated[int, typer.Option(min=4, help="Stop after this many usable views.")] = 60,
    radial: Annotated[
        int, typer.Option(min=1, max=3, help="Number of radial distortion terms; 3 for lenses wider than 100 degrees.")
    ] = 2,
    name: Annotated[str, typer.Option(help="Name of the camera in the file.")] = "camera",
    keep_images: Annotated[bool, typer.Option("--keep-images", help="Save every image that was looked at.")] = False,
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder of the files.")] = Path("runs/calibrate"),
    as_json: Annotated[
        bool, typer.Option("--json", help="Print calibration.json and nothing else; the files are written too.")
    ] = False,
) -> None:
    """Find the lens of a camera.

    The command writes camera_info.yaml, calibration.json and coverage.png. Every --lens reads camera_info.yaml; a poor
    calibration goes to poor_camera_info.yaml instead. The exit code is 0 for a good calibration, else 1.
    """
    asked = CalibrateArguments(
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
    made = make_board(board, columns, rows, square_mm, marker_mm, dictionary, legacy)
    report = run(asked, made, out, quiet=as_json)
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    if report["verdict"] == "poor":
        raise typer.Exit(FAILED)


def run(asked: CalibrateArguments, board: Board, out: Path, *, quiet: bool) -> dict[str, Any]:
    """Look at all images, fit the lens, and write the files.

    Args:
        asked: the options.
        board: the board in the images.
        out: folder of the files.
        quiet: print nothing.

    Returns:
        The content of calibration.json.

    Raises:
        ConfigError: there are no images, or the folder cannot be written.
        CalibrationError: too few images show the board.
        RenderError: the simulated camera finds no OpenGL.
    """
    from tral_env.calibration.camera_info import load_lens
    from tral_env.calibration.views import Collection

    truth = load_lens(asked.lens) if asked.simulated else None
    images, total = _frames(asked, board, truth)
    prepare_folder(out)
    collection = Collection(board)
    with contextlib.closing(images):
        _look(images, collection, asked, out, total, quiet=quiet)
    result = _fit(collection, asked.radial)
    report = _write(result, truth, asked, board, out)
    if not quiet:
        from tral_fsm.cli.calibrate_show import print_calibration

        print_calibration(result, truth)
        typer.echo(f"Files: {out}/{GOOD if result.good else POOR}, calibration.json, coverage.png")
    return report


def _frames(asked: CalibrateArguments, board: Board, truth: CameraConfig | None) -> tuple[Any, int | None]:
    """The images, and their number where that is known."""
    from tral_env.calibration.image_sources import IMAGES, find_sources, read_images

    if truth is None:
        if not asked.sources:
            raise ConfigError("nothing to look at: name images, a folder, a video or a camera, or use --simulated")
        found = find_sources(asked.sources)
        still = all(Path(source).suffix.lower() in IMAGES for source in found)
        return read_images(found, asked.every), len(found) if still else None
    if asked.sources:
        raise ConfigError(f"--simulated makes its own images: leave out {', '.join(asked.sources)}, or --simulated")
    from tral_env.perception import opengl

    opengl.require_loadable()
    from tral_env.simulation.board_scene import simulated_images

    return simulated_images(board, truth, asked.shots, asked.seed), asked.shots


def _look(
    images: Frames, collection: Collection, asked: CalibrateArguments, out: Path, total: int | None, *, quiet: bool
) -> None:
    """Add images to the collection until it has enough views, or Ctrl-C ends a camera."""
    from tral_fsm.cli.calibrate_show import LiveCoverage

    live = any(source.startswith("/dev/") for source in asked.sources)
    with LiveCoverage(collection, total, live=live, quiet=quiet) as show:
        try:
            for name, image in images:
                show(collection.add(name, image))
                if asked.keep_images and image is not None:
                    _keep(out / "images", _looked_at(collection), name, image)
                if len(collection.views) >= asked.max_views:
                    break
        except KeyboardInterrupt:
            # Ctrl-C is the usual end of a camera.
            if not live:
                raise


def _fit(collection: Collection, radial: int) -> Calibration:
    """Fit the lens; an error that hints at another board tells its options."""
    from tral_env.calibration.solve import TooFewViewsError, calibrate_collection

    try:
        return calibrate_collection(collection, radial=radial)
    except TooFewViewsError as error:
        if error.hint is None:
            raise
        raise CalibrationError(f"{error.told} Hint: {board_options.hint_as_options(error.hint)}") from error


def _looked_at(collection: Collection) -> int:
    return len(collection.views) + len(collection.rejected)


def _keep(folder: Path, number: int, name: str, image: NDArray[np.uint8]) -> None:
    """Save an image under its number: two folders may hold images of the same name."""
    import cv2

    prepare_folder(folder)
    stem = Path(name).name.replace(":", "_").replace(".", "_")
    file = folder / f"{number:04d}_{stem}.png"
    if not cv2.imwrite(str(file), image):
        raise ConfigError(f"{file}: cannot be written")


def _write(
    result: Calibration, truth: CameraConfig | None, asked: CalibrateArguments, board: Board, out: Path
) -> dict[str, Any]:
    from tral_env.calibration.camera_info import write_camera_info
    from tral_env.calibration.record import calibration_record
    from tral_fsm.report.calibration import calibration_figure

    file = out / (GOOD if result.good else POOR)
    report = {
        **calibration_record(result, truth),
        "file": str(file),
        "board": asdict(board),
        "arguments": asdict(asked),
        "versions": versions(),
    }
    write_camera_info(file, result.camera, asked.name)
    if result.good:
        (out / POOR).unlink(missing_ok=True)
    write_json(out / "calibration.json", report)
    write_figure(out / "coverage.png", calibration_figure(result), 100)
    return report
