"""What each state of the table does; those that follow walls stand in `test_wall_states`."""

import math
from typing import Any, ClassVar

import pytest
from readings import Bench, one_state, two_states

from tral_env.geometry import curvature
from tral_fsm.definition.machine import STATES


class TestApproachPoint:
    def test_a_point_straight_ahead_needs_no_steering(self) -> None:
        assert one_state(type="ApproachPoint", x=2.0, throttle=0.3).tick() == pytest.approx((0.0, 0.3))

    def test_it_drives_the_circle_through_the_point(self) -> None:
        bench = one_state(type="ApproachPoint", x=1.0, y=1.0, throttle=0.3)
        assert curvature(bench.tick()[0]) == pytest.approx(1.0)

    def test_it_is_finished_on_arrival(self) -> None:
        bench = two_states(
            {"type": "Finished"}, {"type": "ApproachPoint", "x": 1.0, "throttle": 0.3, "tolerance": 0.05}
        )
        bench.tick(distance=0.0)
        bench.tick(distance=0.94)
        assert bench.active == "a"
        bench.tick(distance=0.96)
        assert bench.active == "b"

    def test_a_gate_is_approached_to_a_point_before_it_on_its_axis(self) -> None:
        bench = one_state(type="ApproachPoint", before=1.0, throttle=0.3)
        bench.tick()
        bench.machine.active.set_target(bench.estimate, (3.0, 0.5, math.pi / 2))
        assert bench.machine.active.point == pytest.approx((3.0, -0.5, math.pi / 2))

    def test_a_new_detection_of_its_gate_moves_the_point(self) -> None:
        bench = one_state(type="ApproachPoint", before=1.0, throttle=0.3)
        bench.tick()
        bench.machine.active.set_target(bench.estimate, (3.0, 0.5, 0.0), gate=2)
        bench.see(gate_id=2, gate_x=3.0, gate_y=0.4, gate_age=0.0)
        assert bench.machine.active.point == pytest.approx((2.0, 0.4, 0.0))
        bench.see(gate_id=3, gate_x=5.0, gate_y=0.0, gate_age=0.0)
        assert bench.machine.active.point == pytest.approx((2.0, 0.4, 0.0))

    def test_on_the_axis_of_its_gate_it_goes_straight(self) -> None:
        bench = one_state(type="ApproachPoint", throttle=0.3)
        bench.tick()
        bench.machine.active.set_target(bench.estimate, (3.0, 0.0, 0.0))
        assert bench.tick()[0] == pytest.approx(0.0)


class TestArucoGateCenter:
    @staticmethod
    def center(**gate: float) -> Bench:
        """State "a" begins with a gate in view, and ends in "b"."""
        bench = Bench(
            {
                "root": "look",
                "states": [
                    {"id": "look", "type": "Stop"},
                    {"id": "a", "type": "ArucoGateCenter", "throttle": 0.3, "tolerance_deg": 4.0},
                    {"id": "b", "type": "Stop", "final": True},
                ],
                "transitions": [
                    {"id": "seen", "from": "look", "to": "a", "type": "ArucoGateFound", "hand_over": False},
                    {"id": "t", "from": "a", "to": "b", "type": "Finished"},
                ],
            }
        )
        seen = {"distance": 0.0, "gate_id": 0.0, "gate_age": 0.0, **gate}
        bench.see(**seen)
        bench.out = bench.tick(**seen)  # type: ignore[attr-defined]
        return bench

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_full_lock_towards_the_gates_middle(self, side: float) -> None:
        bench = self.center(gate_x=1.0, gate_y=0.3 * side, gate_heading=0.3 * side)
        assert bench.out == pytest.approx((side, 0.3))  # type: ignore[attr-defined]
        assert bench.active == "a"

    def test_it_is_finished_at_once_when_aligned(self) -> None:
        bench = self.center(gate_x=1.0, gate_y=0.3, gate_heading=math.radians(3.9))
        assert bench.out[0] == 0.0  # type: ignore[attr-defined]
        assert bench.active == "b"

    def test_out_of_view_it_turns_on_by_dead_reckoning(self) -> None:
        bench = self.center(gate_x=2.0, gate_y=1.0, gate_heading=math.radians(20.0))
        driven = 0.0
        while bench.active == "a":
            driven += 0.001
            bench.tick(distance=driven, steering=1.0, speed=0.3)
        assert math.degrees(bench.estimate.yaw) == pytest.approx(16.0, abs=0.2)

    def test_it_is_finished_when_no_gate_has_been_seen(self) -> None:
        bench = two_states({"type": "Finished"}, {"type": "ArucoGateCenter", "throttle": 0.3})
        bench.tick()
        assert bench.active == "b"


class TestMotor:
    def test_fixed_steering_and_throttle(self) -> None:
        assert one_state(type="Motor", steering=-0.4, throttle=0.25).tick(left=0.1) == (-0.4, 0.25)

    def test_it_drives_until_a_transition_fires(self) -> None:
        bench = two_states({"type": "SensorLevel", "below": 0.5}, {"type": "Motor", "steering": 0.3, "throttle": 0.2})
        assert [bench.tick(distance=float(k)) for k in range(9)] == [(0.3, 0.2)] * 9
        bench.tick(front=0.4)
        assert bench.active == "b"

    def test_its_speed_is_regulated(self) -> None:
        assert one_state(type="Motor", speed=0.528).tick(speed=0.528) == pytest.approx((0.0, 0.3))

    def test_it_is_finished_after_its_distance(self) -> None:
        bench = two_states({"type": "Finished"}, {"type": "Motor", "throttle": 0.3, "distance": 1.6})
        bench.tick(distance=5.0)
        bench.tick(distance=6.59)
        assert bench.active == "a"
        bench.tick(distance=6.61)
        assert bench.active == "b"

    def test_reverse_gets_neutral_once_a_second_until_the_car_moves(self) -> None:
        bench = one_state(type="Motor", throttle=-0.3)
        outs = [bench.tick(speed=0.0)[1] for _ in range(97)]
        assert outs == [-0.3] * 80 + [0.0] * 16 + [-0.3]


class TestStopAndIdle:
    def test_stop_brakes_a_rolling_car(self) -> None:
        assert one_state(type="Stop", brake=0.3).tick(speed=1.0) == (0.0, -0.3)

    def test_stop_leaves_a_standing_car_in_neutral(self) -> None:
        assert one_state(type="Stop").tick(speed=0.0) == (0.0, 0.0)

    def test_stop_brakes_a_car_that_rolls_backwards_with_forward_throttle(self) -> None:
        bench = one_state(type="Stop", brake=0.3)
        bench.tick(speed=0.0, throttle=-0.3)
        assert bench.tick(speed=0.5, throttle=-0.3) == (0.0, 0.3)
        assert bench.tick(speed=0.5, throttle=0.3) == (0.0, 0.3)

    def test_stop_stays_in_neutral_after_its_brake_whatever_the_hall_sensor_still_says(self) -> None:
        bench = one_state(type="Stop", brake=0.3)
        assert [bench.tick(speed=speed)[1] for speed in (0.5, 0.2, 0.0, 0.0, 0.2, 0.5)] == [
            -0.3,
            -0.3,
            0.0,
            0.0,
            0.0,
            0.0,
        ]

    def test_stop_keeps_the_car_straight_and_idle_leaves_the_servo_in_neutral(self) -> None:
        steering = {}
        for kind in ("Stop", "Idle"):
            near = {"type": "SensorLevel", "sensor": "front", "below": 0.5}
            bench = two_states(near, {"type": "Motor", "throttle": 0.2, "steering_trim": 0.1}, {"type": kind})
            bench.tick(front=0.4)
            steering[kind] = bench.tick(speed=1.0)[0]
        assert steering == {"Stop": 0.1, "Idle": 0.0}

    def test_idle_does_nothing(self) -> None:
        assert one_state(type="Idle").tick(speed=1.0, left=0.1, front=0.1) == (0.0, 0.0)


class TestFSMState:
    INNER: ClassVar[dict[str, Any]] = {
        "root": 1,
        "states": [{"id": 1, "type": "Motor", "throttle": 0.2, "distance": 1.0}, {"id": 2, "type": "Stop"}],
        "transitions": [{"id": 1, "type": "Finished", "from": 1, "to": 2}],
    }

    def outer(self) -> Bench:
        return Bench(
            {
                "root": "a",
                "states": [
                    {"id": "a", "type": "FSMState", "machine": self.INNER},
                    {"id": "b", "type": "Motor", "throttle": 0.1},
                ],
                "transitions": [
                    {"id": "t", "type": "Finished", "from": "a", "to": "b"},
                    {"id": "back", "type": "Distance", "from": "b", "to": "a", "distance": 1.0},
                ],
            }
        )

    def test_the_inner_machine_drives(self) -> None:
        bench = self.outer()
        assert bench.tick() == (0.0, 0.2)
        assert bench.active == "a/1"

    def test_it_is_finished_in_the_tick_in_which_its_machine_has_ended(self) -> None:
        bench = self.outer()
        bench.tick(distance=0.0)
        bench.tick(distance=1.0)
        assert [(t.path, t.source, t.target) for t in bench.fired] == [(("a",), 1, 2), ((), "a", "b")]

    def test_it_starts_at_its_root_when_it_is_entered_again(self) -> None:
        bench = self.outer()
        for distance in (0.0, 1.0, 2.0):
            bench.tick(distance=distance)
        assert bench.active == "a/1"
        bench.tick(distance=2.5)
        assert bench.active == "a/1"

    def test_machines_stand_in_machines_to_any_depth(self) -> None:
        machine = self.INNER
        for _ in range(10):
            machine = {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": machine, "final": True}]}
        bench = Bench(machine)
        assert bench.tick() == (0.0, 0.2)
        assert bench.active == "/".join(["0"] * 10 + ["1"])


SAMPLES = {
    "BasicFollowWall": {"throttle": 0.1},
    "FollowWall": {"throttle": 0.1},
    "FollowWallRamp": {"throttle": 0.1},
    "ApproachPoint": {"throttle": 0.1},
    "SCurve": {"throttle": 0.1},
    "ArucoGateCenter": {"throttle": 0.1},
    "Motor": {"throttle": 0.1, "distance": 1.0},
    "FollowCorridor": {"throttle": 0.1},
    "Turn": {"throttle": 0.1},
    "BackUp": {"throttle": -0.2},
    "Stop": {},
    "Idle": {},
    "FSMState": {
        "machine": {"root": 0, "states": [{"id": 0, "type": "ApproachPoint", "throttle": 0.1, "final": True}]}
    },
}


@pytest.mark.parametrize("name", SAMPLES)
def test_specs_tell_which_states_are_finishable_and_targetable(name: str) -> None:
    running = one_state(type=name, **SAMPLES[name]).machine.active
    assert hasattr(running, "finished") == running.spec.finishable
    assert hasattr(running, "set_target") == running.spec.takes_target


def test_every_type_of_state_can_run() -> None:
    assert set(SAMPLES) == set(STATES)


def test_the_finishable_and_targetable_states_are_those_of_2016_and_their_like() -> None:
    spec = {name: one_state(type=name, **SAMPLES[name]).machine.active.spec for name in SAMPLES}
    assert {name for name in spec if spec[name].targetable} == {"ApproachPoint", "FollowWallRamp", "SCurve"}
    assert {name for name in spec if spec[name].takes_target and not spec[name].targetable} == {"FSMState"}
    assert {name for name in spec if spec[name].finishable} == {
        "ApproachPoint", "FollowWallRamp", "SCurve", "ArucoGateCenter", "Motor", "Turn", "BackUp", "FSMState",
    }  # fmt: skip
    assert not one_state(type="Motor", throttle=0.1).machine.active.spec.finishable
