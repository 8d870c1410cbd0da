"""What lies outside the picture of a camera."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.perception.frustum import Frustum

AHEAD = Frustum(
    position=np.array([1.0, 0.0, 0.0]),
    forward=np.array([1.0, 0.0, 0.0]),
    up=np.array([0.0, 0.0, 1.0]),
    left=-1.0,
    right=1.0,
    bottom=-0.5,
    top=0.5,
)
metres = st.floats(-5, 5)


@pytest.mark.parametrize(
    ("centre", "radius", "outside"),
    [
        ((3.0, 0.0, 0.0), 0.1, False),
        ((-1.0, 0.0, 0.0), 0.1, True),
        ((-1.0, 0.0, 0.0), 2.1, False),  # the camera is in it
        ((3.0, 2.2, 0.0), 0.1, True),  # the edge is at 2 m; y is left
        ((3.0, -2.2, 0.0), 0.1, True),
        ((3.0, 2.2, 0.0), 0.2, False),
        ((3.0, 0.0, 1.2), 0.1, True),
        ((3.0, 0.0, -1.2), 0.1, True),
        ((-100.0, 0.0, 0.0), 0.0, False),  # a plane has no end
    ],
)
def test_a_sphere_is_outside_if_no_part_of_it_is_in_the_picture(centre, radius, outside):
    assert AHEAD.outside(np.array([centre]), np.array([radius])).tolist() == [outside]


@given(
    point=st.tuples(st.floats(0.01, 5), st.floats(-1, 1), st.floats(-0.5, 0.5)), off=st.tuples(metres, metres, metres)
)
def test_a_sphere_that_holds_a_point_of_the_picture_is_never_outside(point, off):
    ahead, side, rise = point
    seen = AHEAD.position + ahead * np.array([1.0, -side, rise])
    radius = float(np.linalg.norm(off)) + 1e-6
    assert not AHEAD.outside((seen + off)[None], np.array([radius]))[0]
