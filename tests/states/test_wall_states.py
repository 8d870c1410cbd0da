"""What the states do that keep a clearance to a wall."""

import math

import pytest
from readings import Bench, one_state, two_states

from tral_env.geometry import FULL_LOCK, WHEELBASE_M
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.wall import FollowWallRamp, FollowWallRampSpec

LITERAL = {"derivative": "tick", "max_error": None, "max_angle_deg": None, "throttle": 0.3, "clearance": 0.5}


def wall(kind: str = "BasicFollowWall", **changes: object) -> Bench:
    return one_state(type=kind, **{**LITERAL, "p": 2.0, "d": 0.1, "side": "left", **changes})


class TestBasicFollowWall:
    def test_too_far_from_a_left_wall_it_steers_left(self) -> None:
        assert wall().tick(left=0.6) == pytest.approx((0.2, 0.3))

    def test_too_far_from_a_right_wall_it_steers_right(self) -> None:
        assert wall(side="right").tick(right=0.6) == pytest.approx((-0.2, 0.3))

    def test_the_literal_derivative_acts_for_one_tick(self) -> None:
        bench = wall()
        bench.tick(left=0.6)
        assert bench.tick(left=0.61)[0] == pytest.approx(0.22 + 0.1 * 0.01 * 80)
        assert bench.tick()[0] == pytest.approx(0.22)

    def test_the_derivative_is_zero_on_entry(self) -> None:
        assert wall(d=30.0).tick(left=0.6)[0] == pytest.approx(0.2)

    def test_the_integral_sums_e_over_the_ticks(self) -> None:
        bench = wall(i=1.0, d=0.0)
        bench.tick(left=0.6)
        bench.tick()
        assert bench.tick()[0] == pytest.approx(0.2 + 3 * 0.1 * 0.0125)

    def test_the_output_is_clipped(self) -> None:
        assert wall(p=12.0).tick(left=0.9)[0] == 1.0
        assert wall(p=12.0, side="right").tick(right=0.9)[0] == -1.0

    def test_the_derivative_over_the_sonars_interval_is_held_until_the_next_reading(self) -> None:
        bench = wall(derivative="sonar", d=1.0)
        bench.tick(left=0.60)
        for _ in range(4):
            bench.tick()
        # 1 cm in five ticks: 0.16 m/s
        assert bench.tick(left=0.61)[0] == pytest.approx(0.22 + 0.16)
        assert bench.tick()[0] == pytest.approx(0.22 + 0.16)

    def test_a_large_deviation_is_clipped(self) -> None:
        assert wall(max_error=0.1).tick(left=1.5)[0] == pytest.approx(0.2)

    def test_a_wall_is_approached_no_steeper_than_it_can_be_heard(self) -> None:
        # p e = d v sin(30 degrees) at e = 0.05 m
        bench = wall(derivative="sonar", p=4.0, d=0.5, max_angle_deg=30.0)
        assert bench.tick(left=1.5, speed=0.8)[0] == pytest.approx(4.0 * 0.05)

    @pytest.mark.parametrize("speed", [0.5, 1.0, 2.0])
    def test_without_a_d_it_damps_p_at_the_speed_that_the_car_has(self, speed: float) -> None:
        bench = wall(d=None, derivative="sonar", p=1.0, max_rate=10.0)
        bench.tick(left=0.60, speed=speed)
        for _ in range(4):
            bench.tick()
        d = math.sqrt(2.0 * WHEELBASE_M / FULL_LOCK) / speed  # kd = sqrt(2 L kp) / v
        assert bench.tick(left=0.61)[0] == pytest.approx(0.11 + 0.16 * d)

    def test_without_a_d_the_steepest_approach_is_the_same_at_every_speed(self) -> None:
        slow, fast = (
            wall(d=None, derivative="sonar", p=4.0, max_angle_deg=10.0).tick(left=1.5, speed=v)[0] for v in (0.5, 1.5)
        )
        assert slow == pytest.approx(fast)
        assert 0.1 < slow < 0.9

    def test_without_a_wall_it_goes_straight_on(self) -> None:
        bench = wall()
        bench.tick(left=0.6)
        assert bench.tick(left=6.0)[0] == pytest.approx(0.0)

    def test_it_turns_back_to_the_corridors_direction_when_the_wall_is_lost(self) -> None:
        bench = wall()
        bench.tick(left=0.6, distance=0.0)
        for k in range(1, 9):
            bench.tick(distance=0.025 * k, steering=1.0, speed=0.5)
        assert bench.estimate.heading > 0.1
        assert bench.tick(left=6.0)[0] < -0.5

    def test_at_most_half_keeps_to_the_middle_of_a_narrow_place(self) -> None:
        bench = wall(at_most_half=True, clearance=0.8)
        assert bench.tick(left=0.4, right=0.6)[0] == pytest.approx(2.0 * (0.4 - 0.5))
        assert bench.command.wanted_clearance == pytest.approx(0.5)

    def test_it_slows_down_before_something_ahead(self) -> None:
        bench = wall(throttle=None, speed=1.0, slow_front=2.0, slow_speed=0.4)
        targets = []
        for front in (3.0, 1.5, 1.0, 0.3):
            bench.tick(left=0.5, front=front)
            targets.append(bench.driver.speed_target)
        assert targets == pytest.approx([1.0, 0.7, 0.4, 0.4])

    def test_it_says_which_clearance_it_wants(self) -> None:
        bench = wall(side="right")
        bench.tick(right=0.6)
        assert (bench.command.wanted_side, bench.command.wanted_clearance) == (-1.0, 0.5)

    def test_files_that_speak_of_learn_trim_drive_like_all_others(self) -> None:
        assert wall(learn_trim=0.5).tick(left=0.6) == wall().tick(left=0.6)

    def test_a_trim_is_added(self) -> None:
        assert wall(steering_trim=-0.05).tick(left=0.6)[0] == pytest.approx(0.15)


class TestFollowWall:
    def test_a_change_of_more_than_2_cm_is_ignored(self) -> None:
        bench = wall("FollowWall")
        bench.tick(left=0.6)
        assert bench.tick(left=0.63)[0] == pytest.approx(0.2)

    def test_a_change_of_less_is_followed(self) -> None:
        bench = wall("FollowWall", d=0.0)
        bench.tick(left=0.6)
        assert bench.tick(left=0.619)[0] == pytest.approx(0.238)

    def test_a_wall_that_has_moved_for_good_is_followed_from_its_second_reading(self) -> None:
        bench = wall("FollowWall", d=0.0)
        for left in (0.6, 0.7, 0.7):
            out = bench.tick(left=left)
        assert out[0] == pytest.approx(0.4)

    def test_a_jump_does_not_enter_the_derivative_over_the_sonars_interval(self) -> None:
        bench = wall("FollowWall", derivative="sonar", d=1.0)
        for left in (0.6, 0.7, 0.7):
            out = bench.tick(left=left)
        assert out[0] == pytest.approx(0.4)

    def test_one_outlier_leaves_no_trace(self) -> None:
        bench = wall("FollowWall", d=0.0)
        outs = [bench.tick(left=left)[0] for left in (0.6, 1.4, 0.6, 0.6)]
        assert outs == pytest.approx([0.2, 0.2, 0.2, 0.2])


class TestFollowWallRamp:
    @staticmethod
    def ramp(**changes: object) -> Bench:
        state = {"type": "FollowWallRamp", "throttle": 0.3, "start": 0.8, "target": 0.4, "distance": 2.0, **changes}
        return two_states({"type": "Finished"}, state)

    def test_the_clearance_is_linear_in_the_distance_driven(self) -> None:
        bench = self.ramp()
        wanted = []
        for distance in (1.0, 1.5, 2.0, 2.9):
            bench.tick(right=0.6, distance=distance)
            wanted.append(bench.command.wanted_clearance)
        assert wanted == pytest.approx([0.8, 0.7, 0.6, 0.42])

    def test_it_is_finished_at_the_end_of_its_distance(self) -> None:
        bench = self.ramp()
        bench.tick(right=0.6, distance=1.0)
        bench.tick(distance=2.99)
        assert bench.active == "a"
        bench.tick(distance=3.0)
        assert bench.active == "b"

    def test_without_a_start_it_starts_at_the_range_on_entry(self) -> None:
        bench = self.ramp(start=None)
        bench.tick(right=0.6)
        assert bench.command.wanted_clearance == pytest.approx(0.6)

    @pytest.mark.parametrize(("side", "target"), [("right", 0.8 + 0.3), ("left", 0.8 - 0.3)])
    def test_a_target_to_the_left_is_farther_from_a_right_wall_and_nearer_to_a_left_one(
        self, side: str, target: float
    ) -> None:
        bench = self.ramp(side=side)
        bench.tick(right=0.6, left=0.6, distance=1.0)
        # 0.3 m left is x = -0.3 in the camera's frame; 2.4 m ahead are 2250 hall units there
        bench.machine.active.set_target(bench.estimate, (2.4, 0.3, 0.0))
        bench.tick(distance=2.2)
        assert bench.command.wanted_clearance == pytest.approx((0.8 + target) / 2)
        bench.tick(distance=3.3)
        assert bench.command.wanted_clearance == pytest.approx(0.8 + (target - 0.8) * 2.3 / 2.4)

    def test_it_may_end_before_a_target(self) -> None:
        bench = self.ramp(before=1.0)
        bench.tick(right=0.6, distance=1.0)
        bench.machine.active.set_target(bench.estimate, (2.4, 0.3, 0.0))
        bench.tick(distance=1.0 + 1.4)
        assert bench.command.wanted_clearance == pytest.approx(0.8 + 0.3)
        assert bench.active == "b"

    def test_a_target_may_be_turned_by_the_cars_angle_to_the_wall(self) -> None:
        state = FollowWallRamp(FollowWallRampSpec(id=0, throttle=0.3, start=0.8, along_wall=True))
        here = CarEstimate(distance=1.0, heading=0.1)  # the car points to the left of the corridor: so does the point
        state.on_enter(here)
        state.set_target(here, (2.0, 0.0, 0.0))
        there = here._replace(distance=1.0 + 2.0 * math.cos(0.1))
        assert state.tick(there).wanted_clearance == pytest.approx(0.8 + 2.0 * math.sin(0.1))

    @pytest.mark.parametrize(("side", "sign"), [("right", -1.0), ("left", 1.0)])
    def test_the_target_of_2016_in_the_cameras_frame_and_hall_units(self, side: str, sign: float) -> None:
        # setTarget(x, y, z): clearance start - x at a right wall, + x at a left one, after 1500 / 1.60 z hall units
        x_camera, z_camera = 0.25, 2.0
        bench = self.ramp(side=side)
        bench.tick(right=0.8, left=0.8, distance=1.0)
        bench.machine.active.set_target(bench.estimate, (z_camera, -x_camera, 0.0))
        hall_units = 1500 / 1.60 * z_camera
        bench.tick(distance=1.0 + (hall_units - 1) / (1500 / 1.60))
        assert bench.active == "a"
        bench.tick(distance=1.0 + hall_units / (1500 / 1.60))
        assert bench.command.wanted_clearance == pytest.approx(0.8 + sign * x_camera)
        assert bench.active == "b"
