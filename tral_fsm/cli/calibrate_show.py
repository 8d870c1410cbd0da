"""The terminal's view of a calibration: the growing coverage on stderr, the result on stdout."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np
from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from tral_env.calibration.record import difference_px, parameters
from tral_env.calibration.solve import uncovered
from tral_env.calibration.views import Collection, Rejected, View
from tral_fsm.cli.board_options import hint_as_options
from tral_fsm.terminal import print_figures

if TYPE_CHECKING:
    from tral_env.calibration.solve import Calibration
    from tral_env.config import CameraConfig

_MAX_WORST = 5
"""Number of bad views that the terminal lists; calibration.json lists all."""
_MAX_NAMED = 3
"""Number of images that are named for each reason of rejection."""


class LiveCoverage:
    """The coverage map of a collection; each image redraws it."""

    def __init__(self, collection: Collection, total: int | None, *, live: bool = False, quiet: bool = False) -> None:
        """Prepare the map; entering the context shows it.

        Args:
            collection: the views so far.
            total: number of images to come, if that is known.
            live: whether the images come from a camera, which Ctrl-C stops.
            quiet: show nothing.
        """
        self._collection, self._total, self._live = collection, total, live
        self._screen = Live(console=Console(stderr=True, quiet=quiet), refresh_per_second=8)
        self._last = ""

    def __call__(self, seen: View | Rejected) -> None:
        """Show the result of an image."""
        self._last = f"{seen.name}: "
        self._last += f"{len(seen.ids)} corners" if isinstance(seen, View) else f"{seen.reason}, {_detail(seen)}"
        self._screen.update(self._picture())

    def _picture(self) -> Group:
        used, turned_down = len(self._collection.views), len(self._collection.rejected)
        of = f" of {self._total}" if self._total else ""
        reasons = ", ".join(f"{count} {reason}" for reason, count in self._collection.reasons().items())
        lines = [f"{used + turned_down}{of} images, {used} of use" + (f"; {reasons}" if reasons else ""), self._last]
        bare = uncovered(self._collection.coverage())
        lines.append(f"bring the board to: {', '.join(bare)}" if bare else "the board was everywhere")
        if self._live:
            lines.append("Ctrl-C: enough")
        return Group(
            coverage_table(self._collection.coverage()), *(Text(line, no_wrap=line is self._last) for line in lines)
        )

    def __enter__(self) -> LiveCoverage:
        """Show the map."""
        self._screen.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, tb: TracebackType | None) -> None:
        """Stop; the last map stays on the screen."""
        self._screen.stop()
        if not self._screen.console.is_terminal:
            self._screen.console.line()  # in a file it would run into what follows


def coverage_table(counts: np.ndarray[tuple[int, ...], np.dtype[np.int64]]) -> Table:
    """Number of corners in each cell of the image."""
    table = Table(box=box.SQUARE, show_header=False, show_lines=True, padding=(0, 0), title_justify="left")
    for _ in range(counts.shape[1]):
        table.add_column(justify="center", width=5)
    for row in counts:
        table.add_row(*(Text(str(int(count)) if count else "-", style=_style(int(count))) for count in row))
    return table


def _style(count: int) -> str:
    if count == 0:
        return "bold red"
    return "yellow" if count < 3 else "green"


def print_calibration(result: Calibration, truth: CameraConfig | None = None) -> None:
    """Print parameters, errors, rejections and the verdict.

    Args:
        result: the calibration.
        truth: the true lens, where that is known.
    """
    print_figures(_parameter_table(result, truth))
    console = Console(highlight=False, soft_wrap=True)
    worst = np.argsort(-result.errors_px, kind="stable")[:_MAX_WORST]
    named = ", ".join(f"{result.views[i].name} {result.errors_px[i]:.2f}" for i in worst)
    console.print(
        f"RMS {result.rms_px:.3f} px over {len(result.views)} views; held out {result.held_out_px:.3f} px", markup=False
    )
    if truth is not None:
        mean, maximum = difference_px(result.camera, truth)
        console.print(
            f"Pixels of the two lenses differ by {mean:.2f} px on average, {maximum:.2f} at most", markup=False
        )
    console.print(f"Worst views [px]: {named}", markup=False)
    for reason in dict.fromkeys(one.reason for one in result.rejected):
        ones = [one for one in result.rejected if one.reason == reason]
        listed = "; ".join(f"{one.name}: {_detail(one)}" for one in ones[:_MAX_NAMED]) + (
            "; ..." * (len(ones) > _MAX_NAMED)
        )
        console.print(f"Rejected, {reason}: {len(ones)} ({listed})", markup=False)
    console.print(Text("good", style="bold green") if result.good else Text("poor", style="bold red"))
    for line in result.advice:
        console.print(f"- {line}", markup=False)


def _detail(one: Rejected) -> str:
    return f"{one.detail}; {hint_as_options(one.hint)}" if one.hint else one.detail


def _parameter_table(result: Calibration, truth: CameraConfig | None) -> Table:
    title = Text(f"Lens of {result.camera.width} x {result.camera.height} px")
    table = Table("", title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("value", "std. dev.", *(("true", "error") if truth else ())):
        table.add_column(heading, justify="right", no_wrap=True)
    true = parameters(truth) if truth else {}
    for name, value in parameters(result.camera).items():
        pixels = name in ("fx", "fy", "cx", "cy")
        digits = 2 if pixels else 5
        cells = [f"{value:.{digits}f}", f"{result.deviation[name]:.{digits}f}"]
        if truth:
            error = f"{100 * (value / true[name] - 1):+.3f} %" if pixels else f"{value - true[name]:+.5f}"
            cells += [f"{true[name]:.{digits}f}", error]
        table.add_row(name, *cells)
    return table
