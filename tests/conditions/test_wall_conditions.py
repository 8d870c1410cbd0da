"""Conditions on walls, openings and obstacles."""

import math

import pytest
from readings import two_states

from tral_env.geometry import SIDE_SONAR_X_M
from tral_fsm.conditions.walls import MoreRoom, MoreRoomSpec
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.front_obstacle import FrontObstacle
from tral_fsm.estimation.wall_filter import WallEstimate
from tral_fsm.states.basic import Idle, IdleSpec


def beside(left: float = math.nan, right: float = math.nan, yaw: float = 0.0, **ahead: float) -> CarEstimate:
    """A car at the origin of a corridor along x: known ranges to its walls, and what is ahead."""
    return CarEstimate(
        yaw=yaw,
        heading=yaw,
        left_wall=WallEstimate(1.0, left, SIDE_SONAR_X_M, 0.0),
        right_wall=WallEstimate(-1.0, right, SIDE_SONAR_X_M, 0.0),
        obstacle=FrontObstacle(**ahead),
    )


def more_room_on_the_left() -> MoreRoom:
    return MoreRoom(MoreRoomSpec(side="left"), Idle(IdleSpec(id=0)))


class TestConditions:
    def test_more_room_compares_the_walls(self) -> None:
        condition = more_room_on_the_left()
        assert condition.triggered(beside(left=1.0, right=0.8))
        assert not condition.triggered(beside(left=0.8, right=1.0))
        assert condition.triggered(beside(right=0.8))

    @pytest.mark.parametrize(("heading", "fires"), [(-0.3, True), (0.0, False), (0.3, False)])
    def test_a_car_that_drives_aslant_compares_the_walls_beside_what_is_ahead(
        self, heading: float, fires: bool
    ) -> None:
        estimate, condition = beside(left=0.8, right=1.0, yaw=heading, range=1.0), more_room_on_the_left()
        assert condition.triggered(estimate) == fires
        left, right = (float(part.split()[1]) for part in condition.why(estimate).split(", ")[:2])
        assert right - left == pytest.approx(0.2 + 2.0 * 1.304 * math.sin(heading), abs=0.01)

    def test_what_has_just_come_up_counts_before_the_wall_far_behind_it(self) -> None:
        estimate = beside(left=1.0, right=0.8, yaw=0.08, range=4.0, last_range=0.5)
        assert more_room_on_the_left().triggered(estimate)

    def test_something_ahead_asks_from_where_it_has_been_heard(self) -> None:
        wall = two_states({"type": "ObstacleAhead", "below": 1.0, "heard_above": 1.8})
        box = two_states({"type": "ObstacleAhead", "below": 1.0, "heard_below": 1.8})
        for k in range(30):
            for bench in (wall, box):
                bench.tick(front=2.0 - 0.04 * k, distance=0.04 * k, speed=0.5)
        assert (wall.active, box.active) == ("b", "a")

    def test_an_obstacle_is_nearer_than_the_car_needs_to_stop(self) -> None:
        # 0.3 m room + 0.6 m/s 0.4 s + 0.6^2 / (2 1.5) = 0.66 m
        fast, slow = two_states({"type": "ObstacleAhead"}), two_states({"type": "ObstacleAhead"})
        for bench, speed in ((fast, 0.6), (slow, 0.1)):
            bench.tick(front=0.67, speed=speed)
            bench.tick(front=0.665)
            assert bench.active == "a"
            bench.tick(front=0.65)
        assert (fast.active, slow.active) == ("b", "a")
        assert fast.fired[0].why.startswith("0.65 < 0.66 m ahead")

    def test_an_obstacle_that_comes_up_suddenly_is_heard_by_two_readings_that_agree(self) -> None:
        bench = two_states({"type": "ObstacleAhead", "below": 0.6})
        for front in (3.0, 2.96, 2.92, 0.5):
            bench.tick(front=front)
        assert bench.active == "a"
        bench.tick(front=0.49)
        assert bench.active == "b"

    def test_as_many_readings_must_agree_as_asked_for(self) -> None:
        bench = two_states({"type": "ObstacleAhead", "below": 0.6, "readings": 3})
        seen = []
        for front in (0.5, 0.5, 2.0, 0.5, 0.5, 0.5):
            bench.tick(front=front)
            seen.append(bench.active)
        assert seen == ["a"] * 3 + ["b"] * 3

    def test_a_new_obstacle_does_not_fire_before_six_readings_tell_how_far_aside_it_is(self) -> None:
        bench = two_states({"type": "ObstacleAhead", "below": 3.0, "aside_below": 0.3})
        seen = []
        for k in range(8):
            bench.tick(front=2.0 - 0.06 * k, distance=0.06 * k, speed=0.5)
            seen.append(bench.active)
        assert seen == ["a"] * 5 + ["b"] * 3

    @pytest.mark.parametrize(("readings", "beyond"), [(2, 6.0), (3, 6.0), (5, 6.0), (2, 1.6), (3, 1.6)])
    def test_an_opening_fires_after_so_many_readings(self, readings: int, beyond: float) -> None:
        bench = two_states({"type": "Opening", "side": "right", "readings": readings})
        for _ in range(4):
            bench.tick(right=0.8)
        seen = []
        for _ in range(readings):
            bench.tick(right=beyond)
            seen.append(bench.active)
        assert seen == ["a"] * (readings - 1) + ["b"]

    def test_a_wall_that_was_not_heard_twice_is_no_opening_to_three_readings(self) -> None:
        bench = two_states({"type": "Opening", "side": "right", "readings": 3})
        for reading in (0.8, 0.8, 0.8, 0.8, 6.0, 6.0, 0.8, 0.8, 0.8, 6.0, 6.0):
            bench.tick(right=reading)
        assert bench.active == "a"
