"""The approach on two arcs: how it is followed, and when its target is out of reach."""

import math

import pytest
from readings import Bench, one_state, two_states

from tral_env.geometry import curvature, steering_play
from tral_env.se2 import Pose, clip, relative
from tral_fsm.control import biarc as arcs

HERE = (0.0, 0.0, 0.0)
TICK = 1 / 80


def approach(
    gate: tuple[float, float, float], trim: float = 0.0, see: bool = True, **state: object
) -> tuple[Pose, Bench]:
    """A bicycle with a slow servo and a fault of the steering drives to a gate; gives its end and the bench."""
    bench = two_states(
        {"type": "ArucoGateFound", "max_distance": 10.0},
        {"type": "Motor", "throttle": 0.2},
        {"type": "SCurve", "throttle": 0.2, **state},
    )
    pose, wheel, speed, driven, steering = HERE, 0.0, 0.5, 0.0, 0.0
    seen = {"gate_id": 0.0, "gate_age": 0.0}
    for k in range(2000):
        x, y, heading = relative(pose, gate)
        new = {**seen, "gate_x": x, "gate_y": y, "gate_heading": heading} if k < 2 or (see and k % 5 == 0) else {}
        steering, _ = bench.tick(distance=driven, speed=speed, steering=steering, **new)
        if getattr(bench.machine.active, "finished", False):
            break
        behind = steering + trim - wheel
        wheel += clip(behind - clip(behind, steering_play(speed)), TICK / 0.15)
        turning = curvature(wheel)
        pose = arcs.pose_on_arc(pose, speed * TICK, turning)
        driven += speed * TICK * (1 - turning * 0.155 / 2)
    return relative(gate, pose), bench


class TestSCurve:
    @pytest.mark.parametrize("trim", [0.0, 1 / 22, -1 / 22])
    @pytest.mark.parametrize("gate", [(3.0, 0.0, 0.0), (3.0, 0.5, 0.0), (3.0, -0.5, 0.15), (2.5, 0.2, -0.2)])
    def test_it_comes_to_the_gates_axis_though_the_steering_is_off_by_a_degree(self, gate: Pose, trim: float) -> None:
        (x, y, heading), _ = approach(gate, trim)
        assert x == pytest.approx(-0.5 - 0.05, abs=0.02)
        assert abs(y) < 0.03
        assert abs(math.degrees(heading)) < 4.0

    def test_one_detection_and_dead_reckoning_do_it_with_a_straight_steering(self) -> None:
        (_, y, heading), _ = approach((3.0, 0.5, 0.1), see=False)
        assert abs(y) < 0.03
        assert abs(math.degrees(heading)) < 3.0

    def test_behind_a_gate_it_has_passed_along_the_axis(self) -> None:
        (x, y, heading), _ = approach((3.0, 0.4, 0.0), before=-0.4, straight=0.9)
        assert x == pytest.approx(0.35, abs=0.02)
        assert (y, heading) == pytest.approx((0.0, 0.0), abs=0.03)

    def test_its_first_arc_bends_to_the_gates_side(self) -> None:
        bench = one_state(type="SCurve", x=math.sqrt(3.0) + 0.2, y=1.0, straight=0.2, throttle=0.2)
        assert curvature(bench.tick()[0]) == pytest.approx(1.0)

    def test_without_a_target_it_is_the_specs_point(self) -> None:
        bench = one_state(type="SCurve", x=2.0, throttle=0.3)
        assert bench.tick() == pytest.approx((0.0, 0.3))

    def test_a_new_detection_moves_the_target(self) -> None:
        bench = one_state(type="SCurve", before=0.5, straight=0.0, throttle=0.3)
        bench.tick()
        bench.machine.active.set_target(bench.estimate, (3.0, 0.5, 0.0), gate=2)
        bench.see(gate_id=2, gate_x=3.0, gate_y=0.4, gate_age=0.0)
        assert bench.machine.active.target == pytest.approx((2.5, 0.4, 0.0))
        bench.see(gate_id=3, gate_x=5.0, gate_y=0.0, gate_age=0.0)
        assert bench.machine.active.target == pytest.approx((2.5, 0.4, 0.0))


def out_of_reach(first: dict[str, object]) -> bool:
    bench = two_states({"type": "Unreachable"}, {"throttle": 0.2, **first})
    bench.tick()
    return bench.active == "b"


class TestUnreachable:
    @pytest.mark.parametrize("kind", ["SCurve", "ApproachPoint"])
    @pytest.mark.parametrize(
        ("x", "y", "heading_deg", "expected"),
        [
            (2.0, 0.0, 0.0, False),
            (2.0, 0.5, 0.0, False),
            (1.0, 1.0, 0.0, True),  # 1^2 / (4 R) of shift at most, and 1 m sideways
            (0.8, 0.09, 0.0, False),  # within `aside`
            (-1.0, 0.0, 0.0, True),
            (1.5, 0.0, 170.0, True),
        ],
    )
    def test_it_fires_when_the_arcs_would_be_too_tight(
        self, kind: str, x: float, y: float, heading_deg: float, expected: bool
    ) -> None:
        assert out_of_reach({"type": kind, "x": x, "y": y, "heading_deg": heading_deg}) == expected

    @pytest.mark.parametrize(("x", "y", "expected"), [(2.0, 0.5, False), (0.3, 0.5, True), (-0.5, 0.0, True)])
    def test_a_free_point_needs_a_circle_no_smaller_than_full_lock(self, x: float, y: float, expected: bool) -> None:
        assert out_of_reach({"type": "ApproachPoint", "x": x, "y": y}) == expected

    def test_a_ramp_cannot_change_faster_than_it_may_turn(self) -> None:
        ramp = {"type": "FollowWallRamp", "start": 0.9, "target": 0.4, "max_angle_deg": 18.0}
        assert not out_of_reach({**ramp, "distance": 1.6})
        assert out_of_reach({**ramp, "distance": 1.5})

    def test_it_says_why(self) -> None:
        bench = two_states({"type": "Unreachable"}, {"type": "SCurve", "x": 0.8, "y": 0.6, "throttle": 0.2})
        bench.tick()
        assert "0.75 m the least" in bench.fired[0].why

    def test_a_gate_that_comes_out_of_reach_under_way_is_noticed(self) -> None:
        bench = two_states({"type": "Unreachable"}, {"type": "SCurve", "x": 2.0, "y": 0.4, "throttle": 0.2})
        driven = 0.0
        while bench.active == "a" and driven < 3.0:  # the wheels do not turn
            bench.tick(distance=driven, speed=0.5)
            driven += 0.01
        assert 0.5 < driven < 1.9
