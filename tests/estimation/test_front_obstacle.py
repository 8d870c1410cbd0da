"""What is ahead, told from the front range."""

import math

import pytest

from tral_env.interface import NO_ECHO_M
from tral_fsm.estimation.front_obstacle import FrontObstacleTracker


class TestFrontObstacle:
    @pytest.mark.parametrize("aside", [0.0, 0.2, 0.5])
    def test_how_the_range_falls_tells_how_far_aside(self, aside: float) -> None:
        ahead = FrontObstacleTracker()
        for k in range(20):
            ahead.update(math.hypot(2.0 - 0.04 * k, aside), 0.04 * k)
        assert ahead.obstacle.lateral_offset == pytest.approx(aside, abs=1e-6)
        assert ahead.obstacle.first_range == pytest.approx(math.hypot(2.0, aside))

    def test_one_wrong_reading_is_passed_over(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((3.0, 2.96, 0.4, 2.88)):
            ahead.update(reading, 0.04 * k)
        assert (ahead.obstacle.range, ahead.obstacle.first_range) == (2.88, 3.0)

    def test_something_else_is_heard_anew(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((3.0, 2.96, 1.5, 1.46, 1.42, 1.38, 1.34)):
            ahead.update(reading, 0.04 * k)
        assert ahead.obstacle.first_range == 1.38
        assert ahead.obstacle.range == 1.34

    @pytest.mark.parametrize(
        ("off", "heard_from"), [(0.0, 3.0), (0.24, 3.0), (-0.24, 3.0), (0.26, 2.86), (-0.26, 2.34)]
    )
    def test_what_was_lost_is_the_same_where_it_was(self, off: float, heard_from: float) -> None:
        ahead = heard_and_lost(lost_m=0.4)
        ahead.update(3.0 - 0.4 + off, 0.4)
        assert ahead.obstacle.first_range == pytest.approx(heard_from)

    def test_what_was_heard_too_few_times_is_not_remembered(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((3.0, 2.96, *[NO_ECHO_M] * 8)):
            ahead.update(reading, 0.04 * k)
        ahead.update(2.6, 0.4)
        assert ahead.obstacle.first_range == 2.6

    @pytest.mark.parametrize(("lost_m", "heard_from"), [(1.0, 3.0), (1.2, 1.8)])
    def test_what_was_lost_long_ago_is_something_else(self, lost_m: float, heard_from: float) -> None:
        ahead = heard_and_lost(lost_m)
        ahead.update(3.0 - lost_m, lost_m)
        assert ahead.obstacle.first_range == pytest.approx(heard_from)

    def test_a_car_that_backed_off_knows_it_again(self) -> None:
        ahead = heard_and_lost(lost_m=0.4)
        ahead.update(3.0, 0.0)
        assert ahead.obstacle.first_range == 3.0
        ahead = heard_and_lost(lost_m=0.4)
        ahead.update(2.8, 0.2)
        assert ahead.obstacle.first_range == 3.0

    def test_it_is_followed_while_the_car_reverses(self) -> None:
        ahead = FrontObstacleTracker()
        for k in range(20):
            ahead.update(math.hypot(1.0 + 0.04 * k, 0.2), -0.04 * k)
        assert ahead.obstacle.range == pytest.approx(math.hypot(1.76, 0.2))
        assert (ahead.obstacle.support, ahead.obstacle.streak) == (20, 20)
        assert ahead.obstacle.lateral_offset == pytest.approx(0.2)

    def test_it_was_heard_from_no_nearer_than_now(self) -> None:
        ahead = heard_and_lost(lost_m=0.4)
        ahead.update(3.2, -0.2)
        assert ahead.obstacle.first_range == 3.2

    def test_no_echo_is_nothing(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((5.98, NO_ECHO_M, NO_ECHO_M, NO_ECHO_M, NO_ECHO_M, NO_ECHO_M)):
            ahead.update(reading, 0.01 * k)
        assert (ahead.obstacle.nearest, ahead.obstacle.range, ahead.obstacle.first_range) == (
            math.inf,
            math.inf,
            math.inf,
        )

    def test_near_is_what_has_just_come_up(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((3.0, 2.96, 2.92)):
            ahead.update(reading, 0.04 * k)
        assert ahead.obstacle.nearest == 2.92
        ahead.update(0.9, 0.16)
        assert ahead.obstacle.nearest == 0.9


def heard_and_lost(lost_m: float) -> FrontObstacleTracker:
    """Something 3 m ahead of the start was heard for 0.12 m of way, then not until the way is `lost_m`."""
    ahead = FrontObstacleTracker()
    for k in range(4):
        ahead.update(3.0 - 0.04 * k, 0.04 * k)
    for k in range(8):
        way = 0.12 + (lost_m - 0.12) * (k + 1) / 8
        ahead.update(NO_ECHO_M, way)
    return ahead
