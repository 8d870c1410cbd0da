"""Walls around a floor: no gaps, no overlaps, few boxes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tral_env.course.walls import cut_walls

WIDE = 12


def cells(rects: list[tuple[float, float, float, float]]) -> np.ndarray:
    """How many of the rectangles cover each square metre of a field."""
    count = np.zeros((2 * WIDE, 2 * WIDE), int)
    for x0, y0, x1, y1 in rects:
        x0, y0, x1, y1 = (round(edge) + WIDE // 2 for edge in (x0, y0, x1, y1))
        count[y0:y1, x0:x1] += 1
    return count


edge = st.integers(0, WIDE - 2)
size = st.integers(1, 4)
rect = st.tuples(edge, edge, size, size).map(lambda r: (r[0], r[1], r[0] + r[2], r[1] + r[3]))


def test_a_room_has_four_walls():
    walls = cut_walls([(0, 0, 4, 3)], [], 1)
    assert sorted(walls) == [(-1, -1, 5, 0), (-1, 0, 0, 4), (0, 3, 4, 4), (4, 0, 5, 4)]


def test_a_doorway_cuts_its_wall_in_two():
    walls = cut_walls([(0, 0, 4, 3)], [(1, -1, 2, 0)], 1)
    assert sorted(walls)[:2] == [(-1, -1, 1, 0), (-1, 0, 0, 4)]
    assert len(walls) == 5


def test_edges_that_differ_by_rounding_alone_meet():
    assert len(cut_walls([(0, 0, 0.1 + 0.2, 1), (0.3, 0, 1, 1)], [], 0.15)) == 4


@given(st.lists(rect, min_size=1, max_size=6))
def test_walls_cover_what_is_near_the_floor_and_nothing_twice(floor: list[tuple[float, float, float, float]]):
    walls = cells(cut_walls(floor, [], 1))
    near = cells([(x0 - 1, y0 - 1, x1 + 1, y1 + 1) for x0, y0, x1, y1 in floor]) > 0
    assert walls.max() <= 1
    np.testing.assert_array_equal(walls > 0, near & (cells(floor) == 0))
