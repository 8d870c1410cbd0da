"""`tral detect`: the markers and gates that an image, a video or a camera shows, and what is wrong with them."""

from __future__ import annotations

import json
import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tral_env.errors import ConfigError
from tral_fsm.cli.console import FAILED
from tral_fsm.cli.files import suffix_of
from tral_fsm.evaluation.ending import ToldToEnd
from tral_fsm.evaluation.files import prepare_folder
from tral_fsm.terminal import StatusLine

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from tral_env.config import CameraConfig
    from tral_env.perception.sight import Place, Sight

    Named = tuple[str, NDArray[np.uint8] | None]
    """Name of an image or frame, and its pixels (h, w, 3) BGR; None: it cannot be read."""

_PICTURES = (".png", ".jpg", ".jpeg")


def command(
    sources: Annotated[
        list[str], typer.Argument(help="Images, folders, patterns, videos, or a camera such as /dev/video0.")
    ],
    lens: Annotated[
        str | None, typer.Option(help="Lens: default, wide, or a file; with it, distance and bearing are told.")
    ] = None,
    every: Annotated[int, typer.Option(min=1, help="Of a video or a camera, look at one in this many frames.")] = 5,
    out: Annotated[
        Path | None,
        typer.Option(
            dir_okay=False,
            help="A .png or .jpg with all that was seen drawn in; further images get _2, _3, ... in their names.",
            show_default=False,
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON, a line for each image, and nothing else.")
    ] = False,
) -> None:
    """Tell which markers and gates an image shows, where, and what is wrong with them.

    Of a video or a camera, a frame is told if its markers are other ones than those of the frame before. Ctrl-C ends
    it and keeps what was told. The exit code is 0 if any marker was seen, else 1.
    """
    from tral_env.calibration.camera_info import load_lens
    from tral_env.calibration.image_sources import find_sources, read_images

    if out:
        suffix_of(out, _PICTURES)
    camera = None if lens is None else load_lens(lens)
    found = find_sources(sources)
    originals = {Path(name).resolve() for name in found}
    if out:
        for number in range(1, len(found) + 1):
            _require_new(_picture(out, number), originals)
    drawn, progress = 0, _Progress()
    try:
        for name, image in _changes(read_images(found, every), progress):
            sight = _looked_at(image, camera)
            progress.clear()
            typer.echo(json.dumps(_record(name, sight)) if as_json else _text(name, sight))
            if out and image is not None:
                drawn += 1
                picture = _picture(out, drawn)
                _require_new(picture, originals)  # a video gives more pictures than there are sources
                _draw(image, sight, picture, quiet=as_json)
    except KeyboardInterrupt as stopped:  # Ctrl-C is the usual end of a camera
        progress.end(is_stopped=True)
        if isinstance(stopped, ToldToEnd):
            raise
    else:
        progress.end()
    if not progress.seen_any:
        raise typer.Exit(FAILED)


def _changes(images: Iterator[Named], progress: _Progress) -> Iterator[Named]:
    """All images, but of a video or a camera only the frames whose markers differ from those of the frame before."""
    from tral_env.perception.sight import seen_ids

    before: tuple[str, tuple[int, ...]] = "", ()
    for name, image in images:
        ids = () if image is None else seen_ids(image[..., ::-1].copy())
        video = progress.count(name, bool(ids))
        if (video, ids) != before or not video:
            yield name, image
        before = video, ids


class _Progress:
    """How far a video is, on the line of the moment of a terminal; and what to say at its end."""

    def __init__(self) -> None:
        self.seen_any = False
        """Whether any marker was seen."""
        self._line = StatusLine(sys.stderr.fileno(), time.monotonic, math.inf) if sys.stderr.isatty() else None
        self._begin, self._looked, self._with_markers = time.monotonic(), 0, 0
        self._video, self._frame, self._frames = "", 0, 0

    def count(self, name: str, has_markers: bool) -> str:
        """Count an image, and give the name of its video or camera; empty: it is no frame of one."""
        from tral_env.calibration.image_sources import frame_count

        self.seen_any = self.seen_any or has_markers
        video, _, frame = name.rpartition(":")
        if not frame.isdigit():
            return ""
        if video != self._video:
            self._video, self._frames = video, frame_count(video)
        self._frame = int(frame) + 1
        self._looked += 1
        self._with_markers += has_markers
        if self._line:
            self._line.show(self.text())
        return video

    def text(self) -> str:
        """How far it is."""
        of = f" of {self._frames}" if self._frames else ""
        rate = self._looked / max(time.monotonic() - self._begin, 1e-3)
        return (
            f"{self._video}: frame {self._frame}{of}; looked at {self._looked}, {self._with_markers} with markers, "
            f"{rate:.0f} a second"
        )

    def clear(self) -> None:
        """Make room for a line on stdout."""
        if self._line:
            self._line.clear()

    def end(self, *, is_stopped: bool = False) -> None:
        """Say on stderr how far a video came."""
        self.clear()
        if self._looked:
            typer.echo(f"{'Stopped. ' if is_stopped else ''}{self.text()}", err=True)


def _picture(out: Path, number: int) -> Path:
    """File of the picture of that number, 1 or more."""
    return out if number == 1 else out.with_stem(f"{out.stem}_{number}")


def _require_new(picture: Path, originals: set[Path]) -> None:
    if picture.resolve() in originals:
        raise ConfigError(f"--out {picture} is one of the images: choose another name, or another folder")


def _looked_at(image: NDArray[np.uint8] | None, lens: CameraConfig | None) -> Sight:
    from tral_env.perception.sight import Sight, fitted_lens, look

    if image is None:
        return Sight((), (), ("damaged, empty or not to be opened",))
    picture = image[..., ::-1].copy()
    try:
        fitted = lens and fitted_lens(lens, picture.shape[1], picture.shape[0])
    except ConfigError as error:
        sight = look(picture)
        return replace(sight, problems=(f"no places: {error}", *sight.problems))
    return look(picture, fitted)


def _text(name: str, sight: Sight) -> str:
    """What an image shows, a line for each marker, gate and problem."""
    lines = [f"{name}:"]
    for marker in sight.markers:
        lines.append(f"  marker {marker.id}: {marker.meaning}{_where(marker.place)}")
    for gate in sight.gates:
        if gate.place:
            degrees = round(math.degrees(gate.place.heading))
            lines.append(f"  gate {gate.number}{_where(gate.place)}; direction through it: {_signed(degrees)} deg")
        elif not gate.swapped:
            lines.append(f"  gate {gate.number}: both markers are seen")
    return "\n".join([*lines, *(f"  ! {problem}" for problem in sight.problems)])


def _signed(number: int) -> str:
    return f"{number:+d}" if number else "0"


def _where(place: Place | None) -> str:
    from tral_fsm.report.sight import place_text

    return f": {place_text(place)}" if place else ""


def _record(name: str, sight: Sight) -> dict[str, Any]:
    return {
        "image": name,
        "markers": [
            {"id": marker.id, "meaning": marker.meaning, "corners_px": marker.corners.tolist()} | _numbers(marker.place)
            for marker in sight.markers
        ],
        "gates": [{"gate": gate.number, "swapped": gate.swapped} | _numbers(gate.place) for gate in sight.gates],
        "problems": list(sight.problems),
    }


def _numbers(place: Place | None) -> dict[str, float]:
    if place is None:
        return {}
    return {"distance_m": place.distance, "bearing_rad": place.bearing, "heading_rad": place.heading}


def _draw(image: NDArray[np.uint8], sight: Sight, file: Path, *, quiet: bool) -> None:
    import cv2
    import numpy as np

    from tral_env.atomic import write_bytes
    from tral_fsm.report.sight import annotated

    prepare_folder(file.parent)
    drawn = annotated(image[..., ::-1].copy(), sight)
    content = cv2.imencode(file.suffix.lower(), np.ascontiguousarray(drawn[..., ::-1]))[1].tobytes()
    try:
        write_bytes(file, content)
    except OSError as error:
        raise ConfigError(f"--out {file}: cannot be written: {error.strerror}") from error
    if not quiet:
        typer.echo(f"  Written: {file}")
