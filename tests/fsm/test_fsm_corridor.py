"""The observer of the walls, and the states and conditions that drive by it."""

import math

import numpy as np
import pytest
import toy
from hypothesis import given
from hypothesis import strategies as st
from readings import one_state, two_states

from tral_env.geometry import SIDE_SONAR_X_M
from tral_env.interface import NO_ECHO_M
from tral_fsm import load_machine
from tral_fsm.conditions.walls import MoreRoom, MoreRoomSpec
from tral_fsm.definition.machine import IdleSpec
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.front_obstacle import FrontObstacle, FrontObstacleTracker
from tral_fsm.estimation.odometry import CURVATURE_PER_STEERING, OdometrySample
from tral_fsm.estimation.wall_filter import NO_CORRECTION, Wall, WallEstimate, WallFilter
from tral_fsm.runtime.driver import Driver
from tral_fsm.states.basic import Idle

CRUISE = {"type": "FollowCorridor", "throttle": 0.2}


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
            wall.accept(reading, 0.0)
            assert not wall.estimate.known
        wall.accept(0.82, 0.0)
        assert wall.estimate.known
        assert wall.range == pytest.approx(0.81)

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

    def test_turning_out_of_the_corridor_forgets_its_walls(self) -> None:
        walls = settled()
        walls.update(walls.right, 6.0, at(1.04, yaw=math.radians(40.0)), 0.0)
        assert not walls.left.estimate.known
        assert not walls.right.estimate.known

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
        walls = settled(3.0)
        walls.update(walls.left, 6.0, OdometrySample(3.04, 0.0, 1.5, arc_length=3.04, heading_change=1.5), 0.0)
        assert not walls.direction_known

    def test_an_edge_on_one_side_does_not_turn_the_corridor(self) -> None:
        walls = settled(4.0)
        turned = 0.0
        for k in range(10):
            s = 4.0 + 0.04 * k
            turned += walls.update(walls.left, 0.8, at(s), 0.0).heading
            turned += walls.update(walls.right, math.hypot(1.0, 0.04 * k), at(s), 0.0).heading
        assert abs(turned) < math.radians(1.5)

    @given(readings=st.lists(st.tuples(st.floats(0.03, 6.0), st.floats(0.03, 6.0)), min_size=1, max_size=60))
    def test_whatever_is_heard_the_filter_stays_sound(self, readings: list[tuple[float, float]]) -> None:
        walls = WallFilter()
        for k, (left, right) in enumerate(readings):
            sample = OdometrySample(
                *(0.04 * k, 0.0, 0.02 * k % 0.3),
                arc_length=0.04 * k,
                heading_change=0.02 * k,
                lag_heading_change=0.001 * k,
                steering_travel=0.1 * k,
            )
            for wall, reading in ((walls.left, left), (walls.right, right)):
                assert all(math.isfinite(x) for x in walls.update(wall, reading, sample, 0.0))
        covariance = np.array(walls.covariance)
        assert np.allclose(covariance, covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > -1e-12


class TestFrontObstacle:
    @pytest.mark.parametrize("aside", [0.0, 0.2, 0.5])
    def test_how_the_range_falls_tells_how_far_aside(self, aside: float) -> None:
        ahead = FrontObstacleTracker()
        for k in range(20):
            ahead.update(math.hypot(2.0 - 0.04 * k, aside), 0.04 * k, 0.04 * k)
        assert ahead.obstacle.lateral_offset == pytest.approx(aside, abs=1e-6)
        assert ahead.obstacle.first_range == pytest.approx(math.hypot(2.0, aside))

    def test_one_wrong_reading_is_passed_over(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((3.0, 2.96, 0.4, 2.88)):
            ahead.update(reading, 0.04 * k, 0.04 * k)
        assert (ahead.obstacle.range, ahead.obstacle.first_range) == (2.88, 3.0)

    def test_something_else_is_heard_anew(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((3.0, 2.96, 1.5, 1.46, 1.42, 1.38, 1.34)):
            ahead.update(reading, 0.04 * k, 0.04 * k)
        assert ahead.obstacle.first_range == 1.38
        assert ahead.obstacle.range == 1.34

    @pytest.mark.parametrize(
        ("off", "heard_from"), [(0.0, 3.0), (0.24, 3.0), (-0.24, 3.0), (0.26, 2.86), (-0.26, 2.34)]
    )
    def test_what_was_lost_is_the_same_where_it_was(self, off: float, heard_from: float) -> None:
        ahead = heard_and_lost(lost_m=0.4)
        ahead.update(3.0 - 0.4 + off, 0.4, 0.4)
        assert ahead.obstacle.first_range == pytest.approx(heard_from)

    def test_what_was_heard_too_few_times_is_not_remembered(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((3.0, 2.96, *[NO_ECHO_M] * 8)):
            ahead.update(reading, 0.04 * k, 0.04 * k)
        ahead.update(2.6, 0.4, 0.4)
        assert ahead.obstacle.first_range == 2.6

    @pytest.mark.parametrize(("lost_m", "heard_from"), [(1.0, 3.0), (1.2, 1.8)])
    def test_what_was_lost_long_ago_is_something_else(self, lost_m: float, heard_from: float) -> None:
        ahead = heard_and_lost(lost_m)
        ahead.update(3.0 - lost_m, lost_m, lost_m)
        assert ahead.obstacle.first_range == pytest.approx(heard_from)

    def test_a_car_that_backed_off_knows_it_again(self) -> None:
        ahead = heard_and_lost(lost_m=0.4)
        ahead.update(3.0, 0.8, 0.0)
        assert ahead.obstacle.first_range == 3.0
        ahead = heard_and_lost(lost_m=0.4)
        ahead.update(2.8, 0.6, 0.2)
        assert ahead.obstacle.first_range == 3.0

    def test_it_was_heard_from_no_nearer_than_now(self) -> None:
        ahead = heard_and_lost(lost_m=0.4)
        ahead.update(3.2, 1.0, -0.2)
        assert ahead.obstacle.first_range == 3.2

    def test_no_echo_is_nothing(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((5.98, NO_ECHO_M, NO_ECHO_M, NO_ECHO_M, NO_ECHO_M, NO_ECHO_M)):
            ahead.update(reading, 0.01 * k, 0.01 * k)
        assert (ahead.obstacle.nearest, ahead.obstacle.range, ahead.obstacle.first_range) == (
            math.inf,
            math.inf,
            math.inf,
        )

    def test_near_is_what_has_just_come_up(self) -> None:
        ahead = FrontObstacleTracker()
        for k, reading in enumerate((3.0, 2.96, 2.92)):
            ahead.update(reading, 0.04 * k, 0.04 * k)
        assert ahead.obstacle.nearest == 2.92
        ahead.update(0.9, 0.16, 0.16)
        assert ahead.obstacle.nearest == 0.9


def heard_and_lost(lost_m: float) -> FrontObstacleTracker:
    """Something 3 m ahead of the start was heard for 0.12 m of way, then not until the way is `lost_m`."""
    ahead = FrontObstacleTracker()
    for k in range(4):
        ahead.update(3.0 - 0.04 * k, 0.04 * k, 0.04 * k)
    for k in range(8):
        way = 0.12 + (lost_m - 0.12) * (k + 1) / 8
        ahead.update(NO_ECHO_M, way, way)
    return ahead


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


class TestStates:
    def test_the_line_begins_where_the_car_is(self) -> None:
        bench = one_state(**CRUISE, clearance=0.5)
        for _ in range(3):
            bench.tick(right=0.8)
        assert bench.command.wanted_clearance == pytest.approx(0.8)
        assert bench.command.wanted_side == -1.0

    def test_the_line_shifts_by_its_slope(self) -> None:
        bench = one_state(**CRUISE, clearance=0.5, slope=0.1)
        for _ in range(4):
            bench.tick(right=0.8)
        before = bench.command.wanted_clearance
        bench.tick(distance=0.05, speed=0.5)
        bench.tick(distance=0.10, speed=0.5)
        assert before - bench.command.wanted_clearance == pytest.approx(0.01)

    def test_it_drives_slowly_until_it_knows_the_corridor(self) -> None:
        bench = one_state(type="FollowCorridor", speed=1.0, unsure_speed=0.4)
        targets = []
        for k in range(80):
            bench.tick(left=0.8, right=0.8, distance=0.04 * k, speed=0.5)
            targets.append(bench.driver.speed_target)
        assert targets[0] == 0.4
        assert targets[-1] == 1.0
        assert targets == sorted(targets)  # once it knows it stays so

    def test_what_is_slower_anyway_is_not_made_faster(self) -> None:
        bench = one_state(type="FollowCorridor", speed=0.3, unsure_speed=0.45)
        bench.tick(left=0.8, right=0.8)
        assert bench.driver.speed_target == 0.3

    def test_a_trim_that_is_not_to_be_learnt_is_known_to_dead_reckoning_alone(self) -> None:
        taken, left = one_state(**CRUISE), one_state(**CRUISE, learn_trim=False)
        for bench in (taken, left):
            for k in range(60):  # it drifts to the left of straight ahead
                y = 0.5 * 0.1 * (0.04 * k) ** 2
                bench.tick(left=0.8 - y, right=0.8 + y, distance=0.04 * k, speed=0.5)
        assert taken.estimator.steering_offset < -0.03
        assert taken.estimator.offset_error == 0.0
        assert left.estimator.steering_offset == 0.0
        assert left.estimator.offset_error < -0.03

    def test_reversing_it_steers_the_other_way(self) -> None:
        bench = one_state(type="BackUp", throttle=-0.2)
        bench.tick()
        bench.estimator.odometry.yaw = 0.2
        assert bench.tick()[0] > 0.5

    def test_brake_is_held_for_the_motor_controller(self) -> None:
        bench = one_state(type="Stop", hold=0.1)
        pushed = [bench.tick()[1] for _ in range(12)]
        assert pushed[:8] == [-0.3] * 8
        assert pushed[9:] == [0.0] * 3

    @pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
    def test_a_turn_steers_to_its_side_with_the_lock_that_fits(self, side: str, sign: int) -> None:
        far = one_state(type="Turn", side=side, throttle=0.2, lock=0.85)
        assert far.tick()[0] == pytest.approx(sign * 0.85)


@pytest.mark.parametrize("trim", [1 / 22, -1 / 22])
def test_a_car_that_does_not_run_straight_is_found_out(trim: float) -> None:
    world = toy.straight(2.0, y=0.1, trim=trim)
    driver = Driver(load_machine("office"))
    world.drive(toy.one_car(driver), 14)
    assert driver.estimator.steering_offset == pytest.approx(-trim, abs=0.02)
    assert abs(world.path[-1][1]) < 0.15
