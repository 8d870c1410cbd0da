"""Walls around a floor: no gaps, no overlaps, few boxes.

The walls are the floor grown by the wall's thickness, less the floor itself, cut into rectangles on the grid of all
edges: what is not floor is wall, by construction. Edges are whole micrometres, so that edges that should meet do.

A row of the grid is one whole number with a bit for each cell: on grids this small that is many times faster than an
array.
"""

from __future__ import annotations

from tral_env.course.frames import Rect

_PER_M = 1_000_000

_Cells = tuple[int, int, int, int]
"""x0, y0, x1, y1 in micrometres, or in cells of the grid."""


def cut_walls(floor: list[Rect], cut: list[Rect], thickness: float) -> list[Rect]:
    """Put walls around a floor.

    Args:
        floor: rectangles that get walls around their union.
        cut: rectangles inside the walls that are left out: recesses, doors.
        thickness: thickness of the walls, m.

    Returns:
        Rectangles that touch but never overlap, together all of the walls.
    """
    by = round(thickness * _PER_M)
    floors, cuts = _micrometres(floor), _micrometres(cut)
    grown = [(x0 - by, y0 - by, x1 + by, y1 + by) for x0, y0, x1, y1 in floors]
    every = grown + floors + cuts
    xs = sorted({x for x0, _, x1, _ in every for x in (x0, x1)})
    ys = sorted({y for _, y0, _, y1 in every for y in (y0, y1)})
    # A rectangle's cells in a row are the difference of the bits at its edges.
    bit, row = {x: 1 << i for i, x in enumerate(xs)}, {y: i for i, y in enumerate(ys)}
    wall = [0] * (len(ys) - 1)
    for x0, y0, x1, y1 in grown:
        cells = bit[x1] - bit[x0]
        for i in range(row[y0], row[y1]):
            wall[i] |= cells
    for x0, y0, x1, y1 in floors + cuts:
        others = ~(bit[x1] - bit[x0])
        for i in range(row[y0], row[y1]):
            wall[i] &= others
    x, y = [edge / _PER_M for edge in xs], [edge / _PER_M for edge in ys]
    return [(x[x0], y[y0], x[x1], y[y1]) for x0, y0, x1, y1 in _merge(wall)]


def _micrometres(rects: list[Rect]) -> list[_Cells]:
    return [
        (round(x0 * _PER_M), round(y0 * _PER_M), round(x1 * _PER_M), round(y1 * _PER_M)) for x0, y0, x1, y1 in rects
    ]


def _merge(rows: list[int]) -> list[_Cells]:
    """Cover the set cells with rectangles (x0, y0, x1, y1) that do not overlap.

    Each rectangle takes the first run of set cells, as wide as it is, and then as many rows as hold the whole run.

    Args:
        rows: cells of the grid, bit x of row y; emptied.
    """
    rects = []
    for y in range(len(rows)):
        while cells := rows[y]:
            first = cells & -cells
            # Adding the lowest bit clears the run of bits that it begins.
            run = cells & ~(cells + first)
            y1 = y
            while y1 < len(rows) and rows[y1] & run == run:
                rows[y1] ^= run
                y1 += 1
            rects.append((first.bit_length() - 1, y, run.bit_length(), y1))
    return rects
