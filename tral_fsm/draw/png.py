"""A picture of a machine as PNG, drawn by matplotlib."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from tral_fsm.draw.picture import INK, Dot, Line, Mark, Outline, Picture, Words, arrow_head
from tral_fsm.draw.text import SIZE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_DOTS = 12000.0
"""Largest number of dots along a side, more than a screen has. Source: choice."""
_COLOURS = 128
_DPI = 72
"""Resolution at which a px is a point."""


def scale_of(picture: Picture, scale: float = 1.5) -> float:
    """Dots for each px: `scale`, or fewer if the image would be larger than 12000 x 12000."""
    return min(scale, _MAX_DOTS / max(picture.width, picture.height))


def png(picture: Picture, scale: float = 1.5) -> bytes:
    """The picture as a PNG file.

    Args:
        picture: the picture.
        scale: dots for each px; fewer if the image would be larger than 12000 x 12000.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    scale = scale_of(picture, scale)
    figure = Figure(figsize=(picture.width / _DPI, picture.height / _DPI), dpi=_DPI * scale, facecolor="white")
    canvas: Any = FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    ax.set_xlim(0, picture.width)
    ax.set_ylim(picture.height, 0)
    for order, mark in enumerate(picture.marks):
        _draw(mark, ax, order)
    with warnings.catch_warnings():
        # matplotlib draws a letter that the font lacks as a box.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        canvas.draw()
    out = io.BytesIO()
    # Few colours make a third of the size.
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
    image.quantize(_COLOURS, dither=Image.Dither.NONE).save(out, format="PNG", optimize=True)
    return out.getvalue()


def _draw(mark: Mark, ax: Axes, order: int) -> None:
    from matplotlib.patches import Circle, FancyBboxPatch

    if isinstance(mark, Line):
        _line(mark, ax, order)
    elif isinstance(mark, Outline):
        width = 1.8 if mark.strong else 1.0
        style = "round,pad=0,rounding_size=6"
        ax.add_patch(
            FancyBboxPatch(
                (mark.x, mark.y),
                mark.w,
                mark.h,
                style,
                fc=mark.fill,
                ec=mark.colour,
                lw=width,
                zorder=order,
                mutation_aspect=1,
            )
        )
    elif isinstance(mark, Dot):
        ax.add_patch(Circle(mark.centre, mark.radius, fc=INK, ec=INK, zorder=order))
    else:
        _words(mark, ax, order)


def _line(mark: Line, ax: Axes, order: int) -> None:
    from matplotlib.patches import Polygon

    xs, ys = zip(*mark.points, strict=True)
    # The white line below tells crossings from turns.
    ax.plot(xs, ys, color="white", linewidth=4.0, zorder=order, solid_capstyle="butt")
    ax.plot(xs, ys, color=mark.colour, linewidth=1.2, zorder=order, solid_joinstyle="round")
    ax.add_patch(Polygon(arrow_head(mark), fc=mark.colour, ec=mark.colour, lw=0.5, zorder=order))


def _words(mark: Words, ax: Axes, order: int) -> None:
    # Without mathematics a dollar sign stays a dollar sign.
    ax.text(
        *mark.at, mark.text, color=mark.colour, fontsize=SIZE, fontweight="bold" if mark.bold else "normal",
        ha="left" if mark.align == "left" else "center", va="baseline", zorder=order, parse_math=False,
        family="DejaVu Sans",
    )  # fmt: skip
