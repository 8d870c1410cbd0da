"""Places for labels of a drawing, so that they cover neither what is drawn nor one another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from numpy.typing import NDArray

_PAPER = 250
"""A pixel is paper if all its channels are at least this, of 255."""
_STEP_PX, _RINGS, _WAYS = 6, 10, 16
"""Distance between two rings of places round a point, their number, and the places on a ring. Source: choice."""
_NEAR_PX = 14
"""A label that stands farther away has a line to its point."""
_PAD_PX = 2


@dataclass(frozen=True)
class Label:
    """A text for a point of the axes."""

    text: str
    at: tuple[float, float]
    """Point in data units."""
    colour: str = "black"
    size: float = 7.0
    """Height of the letters, points."""


def place_labels(ax: Axes, labels: Sequence[Label]) -> list[Annotation]:
    """Write each label on the nearest free place, one after the other, over what is drawn.

    Call it when all else is drawn and the layout of the figure does not change any more. Where no place near a point
    is free, the label takes the one that covers least. The same drawing always gives the same places.

    Args:
        ax: axes of a figure with an Agg canvas.
        labels: the labels, those that matter most first.

    Returns:
        The labels as they were written, in the same order.
    """
    figure: Any = ax.figure
    canvas: Any = figure.canvas
    canvas.draw()
    taken: NDArray[np.bool_] = np.any(np.asarray(canvas.buffer_rgba())[::-1, :, :3] < _PAPER, axis=2)
    written = []
    for label in labels:
        note = ax.annotate(
            label.text, label.at, (0, 0), textcoords="offset points", ha="center", va="center",
            fontsize=label.size, color=label.colour, zorder=9, parse_math=False,
        )  # fmt: skip
        box = note.get_window_extent(canvas.get_renderer())
        half = np.ceil(np.array([box.width, box.height]) / 2).astype(int) + _PAD_PX
        point = np.round(ax.transData.transform(label.at)).astype(int)
        offset = _free_offset(taken, np.array(ax.bbox.extents), point, half)
        note.set_position(tuple(offset * 72 / figure.dpi))
        if np.hypot(*np.maximum(np.abs(offset) - half, 0)) > _NEAR_PX:
            _lead(ax, label, offset * 72 / figure.dpi)
        taken[_around(point + offset, half)] = True
        written.append(note)
    return written


def _free_offset(
    taken: NDArray[np.bool_], inside: NDArray[np.float64], point: NDArray[np.int_], half: NDArray[np.int_]
) -> NDArray[np.int_]:
    """Offset of a label's middle from its point, px: the nearest place that covers nothing, else the least."""
    best, least = half, math.inf
    for ring, way in product(range(_RINGS), range(_WAYS)):
        # From the upper right on; the label's edge, not its middle, keeps the distance.
        angle = math.pi / 4 + 2 * math.pi * way / _WAYS
        direction = np.array([math.cos(angle), math.sin(angle)])
        offset = np.round(direction * (half + 2 + _STEP_PX * ring)).astype(int)
        low, high = point + offset - half, point + offset + half
        if (low < inside[:2]).any() or (high > inside[2:]).any():
            continue
        covered = int(taken[_around(point + offset, half)].sum())
        if covered < least:
            best, least = offset, covered
        if covered == 0:
            break
    return best


def _around(middle: NDArray[np.int_], half: NDArray[np.int_]) -> tuple[slice, slice]:
    """The pixels of a label, rows from below."""
    (left, low), (right, high) = np.maximum(middle - half, 0), np.maximum(middle + half, 0)
    return slice(low, high), slice(left, right)


def _lead(ax: Axes, label: Label, offset: NDArray[np.float64]) -> None:
    """Draw a thin line from a label to its point; `offset` in points."""
    style = {"arrowstyle": "-", "linewidth": 0.5, "color": label.colour, "shrinkA": 5, "shrinkB": 2}
    ax.annotate("", label.at, tuple(offset), textcoords="offset points", arrowprops=style, zorder=8)
