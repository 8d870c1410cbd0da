"""The lens of a camera from images of a board; its file, calibration.json and coverage.png are kept in a folder.

Heavy modules are imported when the program runs, because `tral --help` imports its arguments.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tral_env.errors import ConfigError
from tral_env.recording.about import versions
from tral_fsm.evaluation.files import prepare_folder, write_figure, write_json

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from tral_env.calibration.boards import Board
    from tral_env.calibration.solve import Calibration
    from tral_env.calibration.views import Collection, Rejected, View
    from tral_env.config import CameraConfig

    Frames = Iterator[tuple[str, "NDArray[np.uint8] | None"]]

GOOD, POOR = "camera_info.yaml", "poor_camera_info.yaml"
"""Files of a good and of a poor calibration: a poor one never replaces a good one."""


@dataclass(frozen=True, kw_only=True)
class CalibrateArguments:
    """What is looked at and fitted, as calibration.json tells it."""

    sources: tuple[str, ...]
    """Images, folders, patterns, videos or cameras; empty for the simulated camera."""
    simulated: bool
    """Whether a board moves before the simulated camera."""
    lens: str
    """Lens of the simulated camera."""
    shots: int
    """Number of images of the simulated camera."""
    seed: int
    """Seed of the simulated board's poses."""
    every: int
    """Of a video or a camera, one in this many frames is looked at."""
    max_views: int
    """The program stops after this many usable views."""
    radial: int
    """Number of radial distortion terms."""
    name: str
    """Name of the camera in its file."""
    keep_images: bool
    """Whether every image that was looked at is saved."""

    @property
    def live(self) -> bool:
        """Whether a camera gives the images, which Ctrl-C ends."""
        return any(source.startswith("/dev/") for source in self.sources)


Progress = Callable[["Collection", "int | None"], "AbstractContextManager[Callable[[View | Rejected], None]]"]
"""Shows each image's result; it is given the collection, and the number of images where that is known."""


class Calibrated(NamedTuple):
    """The result of a calibration."""

    lens: Calibration
    truth: CameraConfig | None
    """The true lens, where that is known."""
    report: dict[str, Any]
    """The content of calibration.json."""


def run(arguments: CalibrateArguments, board: Board, out: Path, progress: Progress) -> Calibrated:
    """Look at all images, fit the lens, and write the files.

    Args:
        arguments: what is looked at and fitted.
        board: the board in the images.
        out: folder of the files.
        progress: shows the result of each image.

    Raises:
        ConfigError: there are no images, or the folder cannot be written.
        CalibrationError: too few images show the board.
        RenderError: the simulated camera finds no OpenGL.
    """
    from tral_env.calibration.camera_info import load_lens
    from tral_env.calibration.solve import calibrate_collection
    from tral_env.calibration.views import Collection

    truth = load_lens(arguments.lens) if arguments.simulated else None
    images, total = _frames(arguments, board, truth)
    prepare_folder(out)
    collection = Collection(board)
    with contextlib.closing(images), progress(collection, total) as show:
        _look(images, collection, arguments, out, show)
    result = calibrate_collection(collection, radial=arguments.radial)
    return Calibrated(result, truth, _write(result, truth, arguments, board, out))


def _frames(arguments: CalibrateArguments, board: Board, truth: CameraConfig | None) -> tuple[Any, int | None]:
    """The images, and their number where that is known."""
    from tral_env.calibration.image_sources import IMAGES, find_sources, read_images

    if truth is None:
        if not arguments.sources:
            raise ConfigError("nothing to look at: name images, a folder, a video or a camera, or use --simulated")
        found = find_sources(arguments.sources)
        still = all(Path(source).suffix.lower() in IMAGES for source in found)
        return read_images(found, arguments.every), len(found) if still else None
    if arguments.sources:
        raise ConfigError(f"--simulated makes its own images: leave out {', '.join(arguments.sources)}, or --simulated")
    from tral_env.perception import opengl

    opengl.require_loadable()
    from tral_env.simulation.board_scene import simulated_images

    return simulated_images(board, truth, arguments.shots, arguments.seed), arguments.shots


def _look(
    images: Frames,
    collection: Collection,
    arguments: CalibrateArguments,
    out: Path,
    show: Callable[[View | Rejected], None],
) -> None:
    """Add images to the collection until it has enough views, or Ctrl-C ends a camera."""
    try:
        for name, image in images:
            show(collection.add(name, image))
            if arguments.keep_images and image is not None:
                _keep(out / "images", _looked_at(collection), name, image)
            if len(collection.views) >= arguments.max_views:
                break
    except KeyboardInterrupt:
        # Ctrl-C is the usual end of a camera.
        if not arguments.live:
            raise


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
    result: Calibration, truth: CameraConfig | None, arguments: CalibrateArguments, board: Board, out: Path
) -> dict[str, Any]:
    from tral_env.calibration.camera_info import write_camera_info
    from tral_env.calibration.record import calibration_record
    from tral_fsm.report.calibration import calibration_figure

    file = out / (GOOD if result.good else POOR)
    report = {
        **calibration_record(result, truth),
        "file": str(file),
        "board": asdict(board),
        "arguments": asdict(arguments),
        "versions": versions(),
    }
    write_camera_info(file, result.camera, arguments.name)
    if result.good:
        (out / POOR).unlink(missing_ok=True)
    write_json(out / "calibration.json", report)
    write_figure(out / "coverage.png", calibration_figure(result), 100)
    return report
