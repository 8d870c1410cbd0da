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
    def test_what_two_arcs_make_two_arcs_find(self, curvature: float, first: float, second: float) -> None:
        assume(max(first, second) * abs(curvature) < 1.5)
        end = arcs.pose_on_arc(arcs.pose_on_arc(HERE, first, curvature), second, -curvature)
        way = arcs.biarc(*end)
        assert way is not None
        assert way.first + way.second <= first + second + 1e-6
        again = arcs.pose_on_arc(arcs.pose_on_arc(HERE, way.first, way.curvature), way.second, -way.curvature)
        assert again == pytest.approx(end, abs=1e-5)

    @given(st.floats(-1.5, 1.5), st.floats(0.0, 1.9), st.floats(-0.3, 0.3))
    def test_coordinates_beside_an_arc_are_the_inverse_of_a_pose_on_it(
        self, curvature: float, s: float, offset: float
    ) -> None:
        x, y, heading = arcs.pose_on_arc(HERE, s, curvature)
        got = arcs.arc_coordinates(x - offset * math.sin(heading), y + offset * math.cos(heading), curvature)
        assert got == pytest.approx((s, offset, heading), abs=1e-6)


class TestOutOfReach:
    """A shift by 1 m on a way of the square root of 3 m takes arcs of 1 m."""

    SHIFT = (math.sqrt(3.0), 1.0, 0.0)

    @pytest.mark.parametrize(("radius", "aside"), [(0.99, 0.0), (1.1, 0.2)], ids=["arcs lead there", "near enough"])
    def test_within_reach_there_is_no_reason(self, radius: float, aside: float) -> None:
        assert arcs.out_of_reach(self.SHIFT, radius, aside) == ""

    def test_narrower_arcs_than_the_car_can_drive(self) -> None:
        assert arcs.out_of_reach(self.SHIFT, 1.1, 0.0) == "an arc of 1.00 m is needed, 1.10 m the least"
        # 0.1 m less to shift: (3 + 0.81) m^2 / 3.6 m = 1.06 m
        assert arcs.out_of_reach(self.SHIFT, 1.1, 0.1) == "an arc of 1.06 m is needed, 1.10 m the least"

    def test_straight_on_no_arc_is_needed(self) -> None:
        assert arcs.out_of_reach((2.0, 0.1, 0.0), 1e6, 0.1) == ""

    def test_behind(self) -> None:
        assert arcs.out_of_reach((-0.5, 0.0, 0.0), 0.64, 0.1) == "the target is 0.50 m behind"
