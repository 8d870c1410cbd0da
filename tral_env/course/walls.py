"""Walls around a floor: no gaps, no overlaps, few boxes.

The walls are the floor grown by the wall's thickness, less the floor itself, cut into rectangles on the grid of all
edges: what is not floor is wall, by construction. Edges are whole micrometres, so that edges that should meet do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tral_env.course.frames import Rect

_PER_M = 1_000_000


def cut_walls(floor: list[Rect], cut: list[Rect], thickness: float) -> list[Rect]:
    """Rectangles that together are the walls around a floor.

    Args:
        floor: rectangles that get walls around their union.
        cut: rectangles inside the walls that are left out: recesses, doors.
        thickness: of the walls, m.

    Returns:
        Rectangles that touch but never overlap.
    """
    floors, cuts = _micrometres(floor), _micrometres(cut)
    grown = floors + round(thickness * _PER_M) * np.array([-1, -1, 1, 1])
    every = np.concatenate([grown, floors, cuts])
    xs, ys = np.unique(every[:, [0, 2]]), np.unique(every[:, [1, 3]])
    wall = np.zeros((len(ys) - 1, len(xs) - 1), bool)
    for rects, value in ((grown, True), (floors, False), (cuts, False)):
        columns = np.searchsorted(xs, rects[:, [0, 2]]).tolist()
        rows = np.searchsorted(ys, rects[:, [1, 3]]).tolist()
        for (x0, x1), (y0, y1) in zip(columns, rows, strict=True):
            wall[y0:y1, x0:x1] = value
    x, y = (xs / _PER_M).tolist(), (ys / _PER_M).tolist()
    return [(x[x0], y[y0], x[x1], y[y1]) for x0, y0, x1, y1 in _merge(wall)]


def _micrometres(rects: list[Rect]) -> NDArray[np.int64]:
    edges: NDArray[np.int64] = np.rint(np.array(rects, float).reshape(-1, 4) * _PER_M).astype(np.int64)
    return edges


def _merge(cells: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    """Cover the set cells with rectangles (x0, y0, x1, y1) that do not overlap, each first wide, then high."""
    left = cells.copy()
    rects = []
    for y, x in np.argwhere(cells).tolist():
        if not left[y, x]:
            continue
        x1 = x + _run(left[y, x:])
        y1 = y + _run(np.all(left[y:, x:x1], axis=1))
        left[y:y1, x:x1] = False
        rects.append((x, y, x1, y1))
    return rects


def _run(flags: NDArray[np.bool_]) -> int:
    """How many flags are set before the first that is not."""
    return len(flags) if flags.all() else int(flags.argmin())
