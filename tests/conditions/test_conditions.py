"""When each transition of the table fires."""

import math
from typing import Any, ClassVar

import pytest
from readings import Bench, two_states

from tral_env.errors import MachineError
from tral_env.geometry import MARKER_BOARD_WIDTH_M, curvature, steering_play
from tral_env.interface import CONTROL_PERIOD_S
from tral_fsm.conditions.simple import Aligned, AlignedSpec, Finished, FinishedSpec, Unreachable, UnreachableSpec
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.basic import Idle, IdleSpec


def fires(bench: Bench, **readings: float) -> bool:
    bench.tick(**readings)
    return bench.active == "b"


class TestAlways:
    def test_it_fires_in_the_tick_in_which_its_state_gave_its_first_output(self) -> None:
        bench = two_states({"type": "Always"}, {"type": "Motor", "throttle": 0.2})
        assert bench.tick() == (0.0, 0.2)
        assert bench.active == "b"


class TestDistance:
    def test_it_fires_after_a_distance_in_the_state(self) -> None:
        bench = two_states({"type": "Distance", "distance": 1.6})
        assert [fires(bench, distance=d) for d in (10.0, 11.59, 11.61)] == [False, False, True]


class TestTimer:
    def test_it_fires_after_a_time_in_the_state(self) -> None:
        bench = two_states({"type": "Timer", "seconds": 0.1})
        assert [fires(bench) for _ in range(9)] == [False] * 8 + [True]


class TestFinished:
    def test_it_fires_when_its_state_is_finished(self) -> None:
        bench = two_states({"type": "Finished"}, {"type": "Motor", "throttle": 0.1, "distance": 0.5})
        assert [fires(bench, distance=d) for d in (0.0, 0.4, 0.5)] == [False, False, True]

    def test_a_state_that_cannot_finish_is_no_owner(self) -> None:
        with pytest.raises(MachineError, match="Finished leaves Idle, which never finishes"):
            Finished(FinishedSpec(), Idle(IdleSpec(id=0)))


class TestSensorLevel:
    @pytest.mark.parametrize("sensor", ["left", "front", "right"])
    def test_below(self, sensor: str) -> None:
        bench = two_states({"type": "SensorLevel", "sensor": sensor, "below": 0.5})
        assert [fires(bench, **{sensor: r}) for r in (0.6, 0.5, 0.49)] == [False, False, True]

    @pytest.mark.parametrize("sensor", ["left", "front", "right"])
    def test_above(self, sensor: str) -> None:
        bench = two_states({"type": "SensorLevel", "sensor": sensor, "above": 0.5})
        assert [fires(bench, **{sensor: r}) for r in (0.4, 0.5, 0.51)] == [False, False, True]

    def test_no_echo_is_above(self) -> None:
        assert fires(two_states({"type": "SensorLevel", "above": 5.0}), front=6.0)

    def test_so_many_readings_must_agree(self) -> None:
        bench = two_states({"type": "SensorLevel", "below": 0.5, "readings": 2})
        outlier = [fires(bench, front=r) for r in (0.6, 0.4, 0.6, 0.4)]
        assert outlier == [False] * 4
        assert not fires(bench)  # the same reading again is no second one
        assert fires(bench, front=0.4)


class TestTurned:
    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_it_fires_after_a_turn_by_dead_reckoning(self, side: float) -> None:
        bench = two_states({"type": "Turned", "angle_deg": 90})
        driven = 0.0
        while not fires(bench, distance=driven, steering=side, speed=0.5):
            driven += 0.005
        assert math.degrees(bench.estimate.yaw) == pytest.approx(90 * side, abs=1.0)
        # tyres hold the wheels a little short of full lock; the hall sensor sits on the left wheel: 7.75 cm nearer to
        # the middle of a left turn
        radius = 1.0 / curvature(1.0 - steering_play(0.5))
        assert driven == pytest.approx((radius - 0.0775 * side) * math.pi / 2, abs=0.05)


class TestAligned:
    def test_it_fires_when_the_car_points_along_the_corridor(self) -> None:
        aligned = Aligned(AlignedSpec(angle_deg=10), Idle(IdleSpec(id=0)))
        headings = [math.radians(angle) for angle in (11, -11, 9, -9)]
        assert [aligned.triggered(CarEstimate(heading=each)) for each in headings] == [False, False, True, True]

    def test_corridors_meet_at_right_angles(self) -> None:
        across = {"type": "All", "of": [{"type": "Turned", "angle_deg": 45}, {"type": "Aligned", "angle_deg": 10}]}
        bench = two_states(across, {"type": "Motor", "throttle": 0.2, "steering": 1.0})
        driven = 0.0
        while not fires(bench, distance=driven, speed=0.8, steering=1.0, throttle=0.2):
            driven += 0.01
            assert driven < 5.0
        assert math.degrees(bench.estimate.yaw) == pytest.approx(80.0, abs=1.0)


def sees(bench: Bench, **readings: float) -> bool:
    bench.see(**readings)
    return bench.active == "b"


class TestArucoGateFound:
    SEEN: ClassVar[dict[str, Any]] = {
        "gate_id": 3.0,
        "gate_x": 2.0,
        "gate_y": 0.5,
        "gate_heading": 0.1,
        "gate_age": 0.0,
    }
    RAMP: ClassVar[dict[str, Any]] = {"type": "FollowWallRamp", "throttle": 0.1, "start": 0.8}

    def gate(self, **limits: object) -> Bench:
        return two_states({"type": "ArucoGateFound", **limits}, second=self.RAMP)

    def test_it_fires_when_a_gate_is_seen(self) -> None:
        bench = self.gate()
        assert not fires(bench)
        assert sees(bench, **self.SEEN)

    @pytest.mark.parametrize("readings", [2, 3, 5])
    def test_so_many_images_must_agree(self, readings: int) -> None:
        bench = self.gate(readings=readings)
        assert [fires(bench, **self.SEEN) for _ in range(readings)] == [False] * (readings - 1) + [True]

    def test_images_that_disagree_begin_anew(self) -> None:
        bench = self.gate()
        places = (2.0, 3.0, 2.0, 2.0)
        assert [fires(bench, **{**self.SEEN, "gate_x": x}) for x in places] == [False, False, False, True]

    def test_one_image_is_never_enough(self) -> None:
        with pytest.raises(MachineError, match="readings"):
            self.gate(readings=1)

    def test_it_hands_the_gate_to_the_next_state(self) -> None:
        bench = self.gate()
        sees(bench, **self.SEEN)
        assert (bench.machine.active.end_clearance, bench.machine.active.length) == pytest.approx((0.8 + 0.5, 2.0))

    def test_the_position_handed_over_is_that_of_now_not_of_the_image(self) -> None:
        bench = self.gate()
        seen = {**self.SEEN, "gate_age": 0.05}
        for k in range(8):
            bench.tick(distance=0.01 * k, speed=0.8)
        bench.tick(distance=0.08, speed=0.8, **seen)
        bench.tick(**seen)
        # exposed four ticks ago, when the car was 3 cm short of here (the hall value stood still since)
        assert bench.machine.active.length == pytest.approx(2.0 - 0.03)

    @pytest.mark.parametrize(
        ("limits", "seen"),
        [
            ({"ids": [3, 4]}, True),
            ({"ids": [4]}, False),
            ({"max_distance": 2.1}, True),
            ({"max_distance": 2.0}, False),
            ({"max_ahead": 1.9}, False),
            ({"max_bearing_deg": 15}, True),
            ({"max_bearing_deg": 14}, False),
        ],
    )
    def test_its_limits(self, limits: dict[str, object], seen: bool) -> None:
        assert sees(self.gate(**limits), **self.SEEN) == seen

    def test_an_old_detection_is_none(self) -> None:
        assert not sees(self.gate(max_age=0.2), **{**self.SEEN, "gate_age": 0.21})

    def test_a_gate_behind_is_none(self) -> None:
        assert not sees(self.gate(), **{**self.SEEN, "gate_x": -0.1})

    @pytest.mark.parametrize(("limit", "narrow"), [(0.79, False), (0.81, True)])
    def test_the_opening_is_told_by_the_middle_and_one_of_its_markers(self, limit: float, narrow: bool) -> None:
        half = (0.8 + MARKER_BOARD_WIDTH_M) / 2.0
        marker = {"marker_id": 6.0, "marker_x": 2.0, "marker_y": 0.5 + half, "marker_heading": 0.0, "marker_age": 0.0}
        assert sees(self.gate(narrower_than=limit), **self.SEEN, **marker) == narrow

    def test_an_opening_that_nobody_has_seen_is_not_narrow(self) -> None:
        assert not sees(self.gate(narrower_than=5.0), **self.SEEN)


class TestOnePost:
    """The other marker of the gate was never in view."""

    SEEN: ClassVar[dict[str, float]] = {
        "marker_id": 7.0,
        "marker_x": 2.0,
        "marker_y": -0.5,
        "marker_heading": 0.1,
        "marker_age": 0.0,
    }

    def gate(self, **limits: object) -> Bench:
        return two_states({"type": "ArucoGateFound", **limits}, second={"type": "SCurve", "speed": 0.4, "before": 0.0})

    def test_it_is_no_gate_unless_asked_for(self) -> None:
        assert not sees(self.gate(), **self.SEEN)
        assert sees(self.gate(one_post=True), **self.SEEN)

    @pytest.mark.parametrize(("marker", "side"), [(6.0, -1.0), (7.0, 1.0)], ids=["left post", "right post"])
    def test_the_middle_is_guessed_half_a_metre_beside_it(self, marker: float, side: float) -> None:
        bench = self.gate(one_post=True)
        sees(bench, **{**self.SEEN, "marker_id": marker})
        guess = bench.estimate.guessed_gate
        assert guess.id == 3
        x, y, heading = bench.estimate.seen_from_here(guess)
        assert heading == pytest.approx(0.1)
        assert (x - 2.0, y + 0.5) == pytest.approx((-side * 0.5 * math.sin(0.1), side * 0.5 * math.cos(0.1)))

    def test_signs_at_crossings_are_no_posts(self) -> None:
        assert not sees(self.gate(one_post=True), **{**self.SEEN, "marker_id": 40.0})

    def test_a_marker_seen_from_the_side_is_none(self) -> None:
        assert not sees(self.gate(one_post=True), **{**self.SEEN, "marker_heading": 0.9})

    def test_a_gate_that_was_seen_whole_is_not_guessed(self) -> None:
        bench = self.gate(one_post=True, max_age=0.2)
        whole = {"gate_id": 3.0, "gate_x": 9.0, "gate_y": 0.0, "gate_heading": 0.0, "gate_age": 1.0}
        bench.see(**whole)
        assert not sees(bench, **self.SEEN)

    def test_the_way_is_planned_anew_once_the_gate_is_seen_whole(self) -> None:
        bench = self.gate(one_post=True)
        sees(bench, **self.SEEN)
        bench.tick()
        guessed = bench.machine.active.target
        bench.see(gate_id=3.0, gate_x=2.0, gate_y=0.3, gate_heading=0.0, gate_age=0.0)
        x, y, heading = bench.estimate.from_here(bench.machine.active.target)
        assert bench.machine.active.target != guessed
        assert (x, y, heading) == pytest.approx((2.0 - bench.machine.active.spec.straight, 0.3, 0.0))


class TestMarkerFound:
    def test_behaviour_by_marker_id(self) -> None:
        seen = {"marker_id": 40.0, "marker_x": 3.0, "marker_age": 0.0}
        assert sees(two_states({"type": "MarkerFound", "ids": [40]}), **seen)
        assert not sees(two_states({"type": "MarkerFound", "ids": [41]}), **seen)

    def test_a_marker_out_of_view_comes_nearer_by_dead_reckoning(self) -> None:
        bench = two_states({"type": "MarkerFound", "max_ahead": 1.25, "max_age": 3.0})
        assert not sees(bench, distance=0.0, marker_id=40, marker_x=3.0, marker_age=0.0)
        assert not fires(bench, distance=1.74)
        assert fires(bench, distance=1.76)


class TestCombined:
    NEAR: ClassVar[dict[str, Any]] = {"type": "SensorLevel", "sensor": "front", "below": 1.0}
    OPEN: ClassVar[dict[str, Any]] = {"type": "SensorLevel", "sensor": "left", "above": 1.5}

    @pytest.mark.parametrize(
        ("kind", "expected"), [("All", [False, False, False, True]), ("Any", [False, True, True, True])]
    )
    def test_all_and_any(self, kind: str, expected: list[bool]) -> None:
        cases = [(2.0, 1.0), (0.5, 1.0), (2.0, 2.0), (0.5, 2.0)]
        got = [fires(two_states({"type": kind, "of": [self.NEAR, self.OPEN]}), front=f, left=s) for f, s in cases]
        assert got == expected

    def test_not(self) -> None:
        bench = two_states({"type": "Not", "of": [self.NEAR]})
        assert [fires(bench, front=f) for f in (0.5, 2.0)] == [False, True]

    @pytest.mark.parametrize("kind", ["All", "Any"])
    def test_the_trace_tells_the_values_of_parts_that_do_not_hold(self, kind: str) -> None:
        bench = two_states({"type": "Not", "of": [{"type": kind, "of": [self.NEAR, {"type": "Timer", "seconds": 9}]}]})
        assert fires(bench, front=2.0)
        assert bench.fired[0].why == f"Not({kind}(front 2.000 < 1 m; 0.000 >= 9 s))"

    def test_the_trace_tells_the_part_that_holds_alone(self) -> None:
        bench = two_states({"type": "Any", "of": [self.NEAR, self.OPEN]})
        assert fires(bench, front=2.0, left=2.0)
        assert bench.fired[0].why == "Any(left 2.000 > 1.5 m)"

    def test_a_gate_among_others_is_handed_over(self) -> None:
        bench = two_states(
            {"type": "All", "of": [self.NEAR, {"type": "ArucoGateFound"}]}, second=TestArucoGateFound.RAMP
        )
        assert sees(bench, front=0.5, **TestArucoGateFound.SEEN)
        assert bench.machine.active.length == pytest.approx(2.0)


def test_the_trace_tells_the_values_that_were_compared() -> None:
    bench = two_states({"type": "SensorLevel", "below": 0.5})
    bench.tick(front=0.4)
    assert bench.fired[0].why == "front 0.400 < 0.5 m"
    assert (bench.fired[0].source, bench.fired[0].target, bench.fired[0].transition) == ("a", "b", "t")


class Told(Idle):
    """A state that says in each tick what it was told to say."""

    def __init__(self, reasons: list[str]) -> None:
        super().__init__(IdleSpec(id=0))
        self.reasons = reasons

    def unreachable(self, estimate: CarEstimate) -> str:
        return self.reasons[estimate.tick]


def test_unreachable_waits_until_it_has_held_long_enough_without_a_break() -> None:
    condition = Unreachable(UnreachableSpec(seconds=0.1), Told(["far", "far", "", *["far"] * 20]))
    condition.on_enter(CarEstimate())
    fired = [condition.triggered(CarEstimate(tick=k, time=k * CONTROL_PERIOD_S)) for k in range(23)]
    assert fired.index(True) == 3 + 8  # 0.1 s after the break
