"""`tral calibrate`: the lens of a camera from images of a printed board, or of the simulated camera."""

from __future__ import annotations

import contextlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tral_env.errors import ConfigError
from tral_fsm.cli.console import FAILED, versions
from tral_fsm.cli.files import prepare_folder, write_json

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from tral_env.calibration.boards import Board
    from tral_env.calibration.solve import Calibration
    from tral_env.calibration.views import Collection
    from tral_env.config import CameraConfig

    Frames = Iterator[tuple[str, "NDArray[np.uint8] | None"]]

BoardKind = Literal["charuco", "chessboard"]

GOOD, POOR = "camera_info.yaml", "poor_camera_info.yaml"
"""A poor calibration never replaces a good one."""


@dataclass(frozen=True, kw_only=True)
class Calibrating:
    """What was asked for."""

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
    kind: BoardKind, columns: int | None, rows: int | None, square_mm: float | None, marker_mm: float | None
) -> Board:
    """The board that the options describe; what they leave out is that of `tral print board`.

    Raises:
        ConfigError: there is no such board.
    """
    from tral_env.calibration.boards import printed_board

    return printed_board(kind, columns, rows, square_mm, marker_mm)


def command(
    sources: Annotated[
        list[str] | None,
        typer.Argument(help="Images, folders, patterns, videos, or a camera such as /dev/video0.", show_default=False),
    ] = None,
    simulated: Annotated[bool, typer.Option("--simulated", help="Move a board before the simulated camera.")] = False,
    lens: Annotated[str, typer.Option(help="Of the simulated camera: default, wide, or a camera_info file.")] = "wide",
    shots: Annotated[int, typer.Option(min=1, help="Images of the simulated camera.")] = 40,
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated board's poses.")] = 0,
    board: Annotated[BoardKind, typer.Option(help="What is shown.")] = "charuco",
    columns: Annotated[int | None, typer.Option(min=3, help="Squares in a row: 7, on a chessboard 10.")] = None,
    rows: Annotated[int | None, typer.Option(min=3, help="Squares in a column: 5, on a chessboard 7.")] = None,
    square_mm: Annotated[float | None, typer.Option(help="Edge of a square: 36, on a chessboard 25.")] = None,
    marker_mm: Annotated[float | None, typer.Option(help="Edge of a charuco marker: 7/9 of a square.")] = None,
    every: Annotated[int, typer.Option(min=1, help="Of a video or camera, look at one in so many frames.")] = 5,
    max_views: Annotated[int, typer.Option(min=4, help="Stop looking when so many views are of use.")] = 60,
    radial: Annotated[int, typer.Option(min=1, max=3, help="Terms of radial distortion; 3 beyond 100 degrees.")] = 2,
    name: Annotated[str, typer.Option(help="Of the camera, for the file.")] = "camera",
    keep_images: Annotated[bool, typer.Option("--keep-images", help="Save what was looked at as images.")] = False,
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder of the files.")] = Path("runs/calibrate"),
    as_json: Annotated[
        bool, typer.Option("--json", help="Write calibration.json to stdout too, and nothing else.")
    ] = False,
) -> None:
    """Find the lens of a camera.

    Writes camera_info.yaml (read wherever a lens is named; a poor calibration is called poor_camera_info.yaml),
    calibration.json and coverage.png. The exit code is 0 if the calibration is good, 1 if it is poor.
    """
    asked = Calibrating(
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
    report = run(asked, make_board(board, columns, rows, square_mm, marker_mm), out, quiet=as_json)
    if as_json:
        typer.echo(json.dumps(report, indent=2))
    if report["verdict"] == "poor":
        raise typer.Exit(FAILED)


def run(asked: Calibrating, board: Board, out: Path, *, quiet: bool) -> dict[str, Any]:
    """Look at all images, fit, and write the files.

    Args:
        asked: what to look at.
        board: what is shown.
        out: folder of the files.
        quiet: print nothing.

    Returns:
        The content of calibration.json.

    Raises:
        ConfigError: nothing to look at, or a folder that cannot be written.
        CalibrationError: too few images show the board.
        RenderError: no OpenGL for the simulated camera.
    """
    from tral_env.calibration.camera_info import load_lens
    from tral_env.calibration.solve import calibrate_collection
    from tral_env.calibration.views import Collection

    truth = load_lens(asked.lens) if asked.simulated else None
    images, total = _frames(asked, board, truth)
    prepare_folder(out)
    collection = Collection(board)
    with contextlib.closing(images):
        _look(images, collection, asked, out, total, quiet=quiet)
    result = calibrate_collection(collection, radial=asked.radial)
    report = _write(result, truth, asked, board, out)
    if not quiet:
        from tral_fsm.cli.calibrate_show import print_calibration

        print_calibration(result, truth)
        typer.echo(f"Files: {out}/{GOOD if result.good else POOR}, calibration.json, coverage.png")
    return report


def _frames(asked: Calibrating, board: Board, truth: CameraConfig | None) -> tuple[Any, int | None]:
    """The images, and how many there are, if that is known."""
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
    images: Frames, collection: Collection, asked: Calibrating, out: Path, total: int | None, *, quiet: bool
) -> None:
    """Show every image to the collection, until there are enough or somebody says so."""
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
            # The natural end of a camera: the one who holds the board has seen enough.
            if not live:
                raise


def _looked_at(collection: Collection) -> int:
    return len(collection.views) + len(collection.rejected)


def _keep(folder: Path, number: int, name: str, image: NDArray[np.uint8]) -> None:
    """Save an image under its number, since folders may hold images of one name."""
    import cv2

    prepare_folder(folder)
    stem = Path(name).name.replace(":", "_").replace(".", "_")
    file = folder / f"{number:04d}_{stem}.png"
    if not cv2.imwrite(str(file), image):
        raise ConfigError(f"{file}: cannot be written")


def _write(
    result: Calibration, truth: CameraConfig | None, asked: Calibrating, board: Board, out: Path
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
    calibration_figure(result).savefig(out / "coverage.png", dpi=100)
    return report
