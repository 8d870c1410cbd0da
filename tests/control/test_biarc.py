"""Two arcs of equal radius: their geometry."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tral_fsm.control import biarc as arcs

HERE = (0.0, 0.0, 0.0)


class TestArcs:
    def test_a_parallel_shift_takes_two_equal_arcs(self) -> None:
        # a shift of 2 R (1 - cos a) on 2 R sin a; here R = 1 m, a = 60 degrees
        way = arcs.biarc(math.sqrt(3.0), 1.0, 0.0)
        assert way == pytest.approx((1.0, math.pi / 3, math.pi / 3))

    def test_straight_ahead_is_no_arc(self) -> None:
        assert arcs.biarc(3.0, 0.0, 0.0) == pytest.approx((0.0, 1.5, 1.5))

    def test_a_single_arc_is_found_too(self) -> None:
        way = arcs.biarc(1.0, 1.0, math.pi / 2)
        assert way is not None
        assert abs(way.curvature) == pytest.approx(1.0)
        assert way.first + way.second == pytest.approx(math.pi / 2)
        assert min(way.first, way.second) == pytest.approx(0.0, abs=1e-9)

    def test_behind_there_is_none(self) -> None:
        assert arcs.biarc(-2.0, 0.1, 0.0) is None
        assert arcs.biarc(0.0, 0.0, 0.0) is None

    @given(st.floats(-1.5, 1.5), st.floats(0.05, 2.0), st.floats(0.05, 2.0))
    def test_what_two_arcs_make_two_arcs_find(self, bend: float, first: float, second: float) -> None:
        assume(max(first, second) * abs(bend) < 1.5)
        end = arcs.along(arcs.along(HERE, first, bend), second, -bend)
        way = arcs.biarc(*end)
        assert way is not None
        assert way.first + way.second <= first + second + 1e-6
        again = arcs.along(arcs.along(HERE, way.first, way.curvature), way.second, -way.curvature)
        assert again == pytest.approx(end, abs=1e-5)

    @given(st.floats(-1.5, 1.5), st.floats(0.0, 1.9), st.floats(-0.3, 0.3))
    def test_beside_is_the_inverse_of_along(self, bend: float, s: float, offset: float) -> None:
        x, y, heading = arcs.along(HERE, s, bend)
        got = arcs.beside(x - offset * math.sin(heading), y + offset * math.cos(heading), bend)
        assert got == pytest.approx((s, offset, heading), abs=1e-6)
