"""The states that drive by the estimate of the walls."""

import json
import math
from typing import Any

import pytest
import toy
from readings import one_state, two_states

from tral_env.geometry import FRONT_SONAR_X_M, curvature
from tral_fsm import FormatError
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.front_obstacle import FrontObstacle
from tral_fsm.formats.tral_json import loads
from tral_fsm.states.corridor import BackUp, BackUpSpec, Turn, TurnSpec

CRUISE = {"type": "FollowCorridor", "throttle": 0.2}


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

    def test_for_a_car_that_another_one_drives_the_line_is_where_the_car_is(self) -> None:
        shadow, follower = one_state(**CRUISE, clearance=0.8), one_state(**CRUISE, clearance=0.8)
        shadow.driver.shadow(True)
        for k in range(40):  # it comes nearer to the wall, by 2 cm
            readings = {"right": 0.8 - 0.0005 * k, "distance": 0.02 * k, "speed": 0.5}
            shadow.tick(**readings)
            follower.tick(**readings)
        assert shadow.command.wanted_clearance == pytest.approx(shadow.driver.estimate.clearances()[1], abs=0.003)
        assert shadow.command.wanted_clearance < 0.79
        assert follower.command.wanted_clearance == pytest.approx(0.8, abs=0.005)

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

    @pytest.mark.parametrize("learn_trim", [True, False])
    def test_files_that_speak_of_learn_trim_drive_like_all_others(self, learn_trim: bool) -> None:
        told, untold = one_state(**CRUISE, learn_trim=learn_trim), one_state(**CRUISE)
        for k in range(60):  # it drifts to the left of straight ahead
            y = 0.5 * 0.1 * (0.04 * k) ** 2
            readings = {"left": 0.8 - y, "right": 0.8 + y, "distance": 0.04 * k, "speed": 0.5}
            assert told.tick(**readings) == untold.tick(**readings)

    def test_brake_is_held_for_the_motor_controller(self) -> None:
        bench = one_state(type="Stop", hold=0.1)
        pushed = [bench.tick()[1] for _ in range(12)]
        assert pushed[:8] == [-0.3] * 8
        assert pushed[9:] == [0.0] * 3


class TestTurn:
    @staticmethod
    def begun(obstacle: float, **given: Any) -> float:
        """Steering at the beginning of a turn, with an obstacle ahead [m]."""
        turn = Turn(TurnSpec(id=0, throttle=0.2, **given))
        estimate = CarEstimate(obstacle=FrontObstacle(range=obstacle))
        turn.on_enter(estimate)
        steering = turn.tick(estimate).steering
        assert steering is not None
        return steering

    @pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
    def test_its_circle_ends_beside_the_wall_ahead(self, side: str, sign: float) -> None:
        # from the rear axle: radius 1 m, then 0.65 m of room; 0.25 m are kept for lateness
        obstacle = 1.0 + 0.65 + 0.25 - FRONT_SONAR_X_M
        steering = self.begun(obstacle, side=side, room=0.65, lock=0.1)
        assert curvature(steering) == pytest.approx(sign * 1.0)

    def test_it_steers_by_at_least_its_share_of_full_lock(self) -> None:
        assert self.begun(5.0, lock=0.85) == pytest.approx(0.85)

    def test_a_wall_that_is_too_near_asks_for_no_more_than_every_car_can(self) -> None:
        assert self.begun(0.2, lock=0.1) == pytest.approx(0.9)

    @pytest.mark.parametrize("tolerance", [2.0, 10.0])
    @pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
    def test_it_ends_within_its_tolerance_of_a_right_angle(self, side: str, sign: float, tolerance: float) -> None:
        turn = {"type": "Turn", "side": side, "speed": 0.5, "tolerance_deg": tolerance}
        bench = two_states({"type": "Finished"}, turn)
        world = toy.Toy([])
        rest = []
        while bench.active == "a":
            world.drive(toy.one_car(bench.driver), toy.TICK)
            rest.append(90.0 - sign * math.degrees(bench.estimate.yaw))
        assert rest[-1] <= tolerance < rest[-2]
        assert math.degrees(world.yaw) == pytest.approx(sign * (90.0 - tolerance), abs=8.0)


class TestBackUp:
    @pytest.mark.parametrize(
        ("given", "wrong"),
        [
            ({"speed": 0.4}, "/states/0/speed: unknown key 'speed'"),
            ({"throttle": 0.2}, "/states/0/throttle: got 0.2: expected less than 0"),
            ({"throttle": 0.0}, "/states/0/throttle: got 0.0: expected less than 0"),
            ({}, "/states/0: the key 'throttle' is missing"),
        ],
    )
    def test_it_takes_a_throttle_in_reverse_gear_alone(self, given: dict[str, Any], wrong: str) -> None:
        with pytest.raises(FormatError) as caught:
            loads(json.dumps({"root": 0, "states": [{"id": 0, "type": "BackUp", "final": True, **given}]}))
        assert wrong in str(caught.value)

    @pytest.mark.parametrize("heading", [0.2, -0.2])
    def test_reversing_it_steers_to_the_side_to_which_it_points(self, heading: float) -> None:
        back_up = BackUp(BackUpSpec(id=0, throttle=-0.2))
        estimate = CarEstimate(yaw=heading, heading=heading)
        back_up.on_enter(estimate)
        command = back_up.tick(estimate)
        assert command.steering is not None
        assert math.copysign(command.steering, heading) == command.steering
        assert abs(command.steering) > 0.5
        assert (command.throttle, command.speed) == (-0.2, None)

    def test_it_is_finished_after_its_distance(self) -> None:
        bench = two_states({"type": "Finished"}, {"type": "BackUp", "throttle": -0.2, "distance": 0.5})
        bench.tick(distance=3.0)
        bench.tick(distance=3.49)
        assert bench.active == "a"
        bench.tick(distance=3.5)
        assert bench.active == "b"
