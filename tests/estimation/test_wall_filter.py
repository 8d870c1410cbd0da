"""The filter that finds the walls of the corridor."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tral_env.geometry import SIDE_SONAR_X_M
from tral_fsm.estimation.odometry import CURVATURE_PER_STEERING, OdometrySample
from tral_fsm.estimation.wall_filter import NO_CORRECTION, Wall, WallFilter

CERTAIN = 0.0
"""Variance of an innovation that hides nothing."""


def drive(walls: WallFilter, metres: float) -> None:
    """Drive straight ahead between walls at 0.8 m on the left and 1.0 m on the right, 4 cm a reading."""
    for k in range(round(metres / 0.04)):
        walls.update(walls.left, 0.8, at(0.04 * k), 0.0)
        walls.update(walls.right, 1.0, at(0.04 * k), 0.0)


def settled(metres: float = 1.0) -> WallFilter:
    """Walls after driving between them."""
    walls = WallFilter()
    drive(walls, metres)
    return walls


def at(x: float, y: float = 0.0, yaw: float = 0.0) -> OdometrySample:
    """The car was here, after as many metres."""
    return OdometrySample(x, y, yaw, arc_length=x)


class TestWalls:
    def test_a_wall_is_known_after_three_readings_that_agree(self) -> None:
        wall = Wall(1.0)
        for reading in (0.80, 0.81):
            wall.accept(reading, CERTAIN)
            assert not wall.estimate.known
        wall.accept(0.82, CERTAIN)
        assert wall.estimate.known
        assert wall.range == pytest.approx(0.81)

    @pytest.mark.parametrize("place", [0.4, 1.0, 1.6])
    def test_so_is_its_new_place_wherever_it_is(self, place: float) -> None:
        walls = settled()
        for k in range(2):
            walls.update(walls.left, place, at(1.04 + 0.04 * k), 0.0)
            assert walls.left.range != pytest.approx(place)
        walls.update(walls.left, place, at(1.12), 0.0)
        assert walls.left.range == pytest.approx(place)

    def test_a_wall_beyond_an_opening_is_one_from_the_reading_after_those_that_find_it(self) -> None:
        walls = settled()
        lost = []
        for k in range(4):
            walls.update(walls.left, 1.6, at(1.04 + 0.04 * k), 0.0)
            lost.append(walls.left.lost)
        assert lost == [1, 2, 3, 0]

    def test_the_place_of_a_wall_that_is_gone_moves_with_the_car(self) -> None:
        # the wall ends 0.8 m to the left; the car comes 0.3 m nearer, then hears one that is 0.5 m farther than it was
        walls = settled()
        for k in range(2):
            walls.update(walls.left, 6.0, at(1.04 + 0.04 * k), 0.0)
        walls.update(walls.left, 1.0, at(1.12, 0.3), 0.0)
        assert walls.left.lost == 3

    def test_a_wrong_reading_moves_nothing(self) -> None:
        walls = settled()
        assert walls.update(walls.left, 0.5, at(1.04), 0.0) == NO_CORRECTION
        assert walls.left.range == pytest.approx(0.8)

    def test_a_cupboard_becomes_the_wall(self) -> None:
        walls = settled()
        moved = walls.left.moved
        for k in range(3):
            walls.update(walls.left, 0.4, at(1.04 + 0.04 * k), 0.0)
        assert walls.left.range == pytest.approx(0.4)
        assert walls.left.moved == moved + 1

    def test_driving_to_the_left_is_foretold(self) -> None:
        walls = settled()
        fault = walls.update(walls.left, 0.7, at(1.04, 0.1), 0.0)
        assert fault == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
        assert walls.left.range == pytest.approx(0.7)

    def test_after_two_readings_without_a_wall_none_is_known(self) -> None:
        walls = settled()
        walls.update(walls.right, 6.0, at(1.04), 0.0)
        assert walls.right.estimate.known
        walls.update(walls.right, 6.0, at(1.08), 0.0)
        assert walls.right.lost == 2
        assert not walls.right.estimate.known

    def test_at_an_angle_no_echo_is_no_opening(self) -> None:
        walls = settled()
        for k in range(5):
            walls.update(walls.right, 6.0, at(1.04 + 0.04 * k, yaw=math.radians(25.0)), 0.0)
        assert walls.right.lost == 0
        assert walls.right.estimate.known

    @given(degrees=st.floats(-8.0, 8.0))
    def test_a_wrong_direction_is_put_right_within_a_metre(self, degrees: float) -> None:
        walls, along = WallFilter(), 0.0
        slope = math.tan(math.radians(degrees))
        for k in range(25):
            s = 0.04 * k
            for wall, start in ((walls.left, 0.8), (walls.right, 1.0)):
                along -= walls.update(wall, start - wall.sign * slope * s, at(s), along).heading
        assert math.degrees(-along) == pytest.approx(degrees, abs=0.7)
        assert walls.direction_known

    @given(degrees=st.floats(-8.0, 8.0))
    def test_so_it_is_in_reverse(self, degrees: float) -> None:
        walls, along = WallFilter(), 0.0
        slope = math.tan(math.radians(degrees))
        for k in range(25):
            s = -0.04 * k
            for wall, start in ((walls.left, 0.8), (walls.right, 1.0)):
                along -= walls.update(wall, start - wall.sign * slope * s, at(s), along).heading
        assert math.degrees(-along) == pytest.approx(degrees, abs=0.7)

    @given(degrees=st.floats(-2.5, 2.5))
    def test_a_corrected_heading_moves_no_range_at_its_place(self, degrees: float) -> None:
        walls, turn, b = settled(), math.radians(degrees), SIDE_SONAR_X_M
        walls.update(walls.left, 0.8, at(1.04, yaw=0.1), 0.0)
        ranges = walls.left.range, walls.right.range
        walls.correct_heading(turn)
        x, y = 1.04 + b * math.cos(0.1 + turn), b * math.sin(0.1 + turn)
        for wall, range_m in zip((walls.left, walls.right), ranges, strict=True):
            assert wall.estimate.range_from(x, y, 0.0) == pytest.approx(range_m, abs=1e-12)

    @given(degrees=st.floats(-2.5, 2.5))
    def test_after_a_corrected_heading_the_next_range_is_foretold(self, degrees: float) -> None:
        walls, turn = settled(), math.radians(degrees)
        walls.correct_heading(turn)
        x, y = 0.96 + 0.04 * math.cos(turn), 0.04 * math.sin(turn)
        assert walls.update(walls.left, 0.8 - y, at(x, y, turn), 0.0) == pytest.approx(NO_CORRECTION, abs=1e-9)

    @given(fault=st.floats(-0.12, 0.12))
    def test_a_wrong_trim_is_learnt_within_three_metres(self, fault: float) -> None:
        walls, along, yaw, y, trim = WallFilter(), 0.0, 0.0, 0.0, 0.0
        for k in range(75):
            s = 0.04 * k
            for wall, start in ((walls.left, 0.8), (walls.right, 1.0)):
                found = walls.update(wall, start - wall.sign * y, at(s), along)
                along -= found.heading
                trim += found.trim
            # the car holds its wheels where it takes straight ahead to be, and truly turns by what is left
            yaw -= CURVATURE_PER_STEERING * (fault - trim) * 0.04
            y += yaw * 0.04
        assert trim == pytest.approx(fault, abs=0.03)
        assert walls.sure

    def test_nothing_is_sure_at_the_start(self) -> None:
        walls = WallFilter()
        assert not walls.direction_known
        assert not walls.sure
        drive(walls, 3.0)
        assert walls.sure

    def test_a_turn_makes_the_direction_doubtful(self) -> None:
        # 90 degrees on the narrowest circle: 1e-3 m x 1.57 / 0.64 m = (2.8 degrees)^2
        walls = settled(3.0)
        turned = OdometrySample(
            3.64, 0.64, 1.57, arc_length=4.0, heading_change=1.57, heading_variance=1e-3 * 1.57 / 0.64
        )
        walls.update(walls.left, 6.0, turned, 0.0)
        assert not walls.direction_known

    def test_an_edge_on_one_side_does_not_turn_the_corridor(self) -> None:
        walls = settled(4.0)
        turned = 0.0
        for k in range(10):
            s = 4.0 + 0.04 * k
            turned += walls.update(walls.left, 0.8, at(s), 0.0).heading
            turned += walls.update(walls.right, math.hypot(1.0, 0.04 * k), at(s), 0.0).heading
        assert abs(turned) < math.radians(1.5)

    @pytest.mark.parametrize("slope", [-0.3, 0.3])
    def test_a_box_that_stands_askew_does_not_turn_the_corridor(self, slope: float) -> None:
        # the direction is known by 1.7 degrees; a box of 0.28 m, turned by 17 degrees, stands on the right
        walls, turned = settled(4.0), 0.0
        for k in range(10):
            s = 0.04 * k
            sample = OdometrySample(4.0 + s, 0.0, 0.0, 4.0 + s, heading_variance=0.03 * 0.03)
            box = 0.4 + slope * s if k < 7 else 1.0
            turned += walls.update(walls.right, box, sample, -turned).heading
        assert abs(turned) < math.radians(1.0)

    def test_a_wall_that_was_lost_and_is_found_where_it_was_teaches_the_heading_at_once(self) -> None:
        turned = {}
        for place in (0.8, 0.6):
            walls, turned[place] = settled(4.0), 0.0
            for k in range(12):
                s = 0.04 * k
                sample = OdometrySample(4.0 + s, 0.0, 0.0, 4.0 + s, heading_variance=0.03 * 0.03)
                reading = 6.0 if k < 2 else place - 0.05 * (s - 0.08)
                turned[place] += walls.update(walls.left, reading, sample, -turned[place]).heading
        assert math.degrees(turned[0.8]) > 1.0
        assert abs(math.degrees(turned[0.6])) < 0.2

    @given(readings=st.lists(st.tuples(st.floats(0.03, 6.0), st.floats(0.03, 6.0)), min_size=1, max_size=60))
    def test_whatever_is_heard_the_filter_stays_sound(self, readings: list[tuple[float, float]]) -> None:
        walls = WallFilter()
        for k, (left, right) in enumerate(readings):
            sample = OdometrySample(
                *(0.04 * k, 0.0, 0.02 * k % 0.3),
                arc_length=0.04 * k,
                heading_change=0.02 * k,
                heading_variance=1e-4 * k,
                trim_variance=1e-5 * k,
            )
            for wall, reading in ((walls.left, left), (walls.right, right)):
                assert all(math.isfinite(x) for x in walls.update(wall, reading, sample, 0.0))
        assert np.allclose(walls.P, np.transpose(walls.P))
        assert np.linalg.eigvalsh(walls.P).min() > -1e-12
