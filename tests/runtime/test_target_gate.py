"""Which gate a machine has in mind, and how much room is in it."""

from typing import Any

import pytest
from readings import Bench, two_states

from tral_env.interface import CONTROL_PERIOD_S

GATE = {"gate_id": 0.0, "gate_x": 1.0, "gate_y": 0.2, "gate_heading": 0.0, "gate_age": 0.0}


def test_a_gate_seen_whole_is_not_handed_over_as_an_older_guess_from_its_post() -> None:
    found = {"type": "ArucoGateFound", "max_age": 9.9, "one_post": True}
    narrow = {"type": "ArucoGateFound", "max_age": 9.9, "narrower_than": 0.45, "target": True, "hand_over": False}
    bench = Bench(
        {
            "root": "look",
            "states": [
                {"id": "look", "type": "Stop"},
                {"id": "gate", "type": "SCurve", "speed": 0.45},
                {"id": "refused", "type": "Stop"},
            ],
            "transitions": [
                {
                    "id": 0,
                    "from": "look",
                    "to": "gate",
                    "type": "All",
                    "of": [{"type": "Timer", "seconds": 1.0}, found],
                },
                {"id": 1, "from": "gate", "to": "refused", **narrow},
            ],
        }
    )
    post = {"marker_id": 3.0, "marker_x": 1.5, "marker_y": -0.7, "marker_heading": 0.0, "marker_age": 0.05}
    bench.see(**post)
    for _ in range(20):
        bench.tick()
    bench.see(gate_id=1.0, gate_x=1.5, gate_y=-0.42, gate_heading=0.0, gate_age=0.05, **post)
    assert bench.estimate.target_gate.id == -1
    for _ in range(80):
        bench.tick()
    assert (bench.estimate.target_gate.id, bench.estimate.target_gate.y) == (1, bench.estimate.gate.y)
    assert bench.active == "refused"


class TestTheRoomInAGate:
    def seen(self, opening: float, y: float) -> Bench:
        """A gate one metre ahead whose middle is y to the left, beside a way straight on."""
        bench = two_states({"type": "ArucoGateFound", "missed_by": 0.1, "hand_over": False})
        marker = {"marker_id": 0.0, "marker_x": 1.0, "marker_y": y + (opening + 0.24) / 2, "marker_age": 0.0}
        bench.see(**{**GATE, "gate_y": y}, **(marker if opening else {}))
        return bench

    @pytest.mark.parametrize(("y", "missed"), [(0.05, False), (0.15, True)])
    def test_without_an_opening_it_is_what_the_file_says(self, y: float, missed: bool) -> None:
        assert (self.seen(0.0, y).active == "b") == missed

    @pytest.mark.parametrize(("y", "missed"), [(0.27, False), (0.29, True)])
    def test_with_one_the_car_must_fit_between_the_posts(self, y: float, missed: bool) -> None:
        # 0.8 m wide: half of it less half the car and 2 cm
        assert (self.seen(0.8, y).active == "b") == missed


def test_of_a_whole_gate_and_a_nearer_post_the_post_is_taken() -> None:
    bench = two_states(
        {"type": "ArucoGateFound", "one_post": True}, second={"type": "SCurve", "throttle": 0.2, "before": 0.0}
    )
    far = {**GATE, "gate_id": 1.0, "gate_x": 5.0}
    bench.see(**far, marker_id=1.0, marker_x=2.0, marker_y=-0.3, marker_heading=0.0, marker_age=0.0)
    assert bench.active == "b"
    assert bench.machine.active.gate == 0
    assert bench.machine.active.target[1] == pytest.approx(0.2)


class TestTheTarget:
    """A gate that a state was handed stays the one, though a gate behind it is seen whole instead."""

    @staticmethod
    def handed(condition: dict[str, Any], last: dict[str, Any]) -> Bench:
        """A machine that was handed gate 0, and then saw gate 1 behind it, to the right."""
        bench = Bench(
            {
                "root": "a",
                "states": [
                    {"id": "a", "type": "Motor", "throttle": 0.2},
                    {"id": "b", "type": "SCurve", "throttle": 0.2, "before": 0.0},
                    {"id": "c", "final": True, **last},
                ],
                "transitions": [
                    {"id": "ab", "from": "a", "to": "b", "type": "ArucoGateFound", "ids": [0]},
                    {"id": "bc", "from": "b", "to": "c", **condition},
                ],
            }
        )
        behind = {"gate_id": 1.0, "gate_x": 5.0, "gate_y": -1.0, "gate_heading": -0.5, "gate_age": 0.0}
        for seen in (GATE, behind, GATE, behind):  # each is believed in its second image
            bench.tick(**seen)
        return bench

    def test_a_condition_asks_the_nearest_gate_or_the_target(self) -> None:
        far = {"type": "ArucoGateFound", "max_distance": 2.0, "hand_over": False}
        assert self.handed(far, {"type": "Stop"}).active == "b"
        assert self.handed({**far, "target": True}, {"type": "Stop"}).active == "c"

    def test_it_grows_older_while_it_is_out_of_view(self) -> None:
        old = {"type": "Not", "of": [{"type": "ArucoGateFound", "target": True, "max_age": 0.5, "hand_over": False}]}
        bench = self.handed(old, {"type": "Stop"})
        ticks = 0
        while bench.active == "b":
            bench.tick(gate_id=1.0, gate_x=5.0, gate_y=-1.0, gate_heading=-0.5, gate_age=0.0)
            ticks += 1
        assert ticks == pytest.approx(0.5 / CONTROL_PERIOD_S, abs=1)

    def test_full_lock_is_towards_the_target(self) -> None:
        bench = self.handed({"type": "Always"}, {"type": "ArucoGateCenter", "throttle": 0.2, "tolerance_deg": 1.0})
        driven = 0.0
        while bench.estimate.yaw < 0.1:  # the car turns towards it, and not far enough
            driven += 0.005
            assert driven < 0.5
            steering, _ = bench.tick(distance=driven, speed=0.4, steering=1.0)
        assert bench.active == "c"
        assert bench.estimate.target_gate.id == 0
        assert steering == pytest.approx(1.0)

    def test_a_target_behind_the_car_is_done_with(self) -> None:
        near = {"type": "SensorLevel", "sensor": "front", "below": 0.5}
        bench = self.handed(near, {"type": "ArucoGateCenter", "throttle": 0.2})
        assert bench.estimate.target_gate.id == 0
        driven = 0.0
        while bench.estimate.seen_from_here(bench.estimate.target_gate)[0] > -0.2:
            driven += 0.02
            assert driven < 5.0
            bench.tick(distance=driven, speed=1.0, front=2.0)
        bench.tick(front=0.4)
        assert bench.active == "c"
        bench.tick()
        assert bench.estimate.target_gate.id == 1

    def test_where_none_was_handed_over_the_nearest_is_turned_to(self) -> None:
        bench = two_states({"type": "Distance", "distance": 0.5}, second={"type": "ArucoGateCenter", "throttle": 0.2})
        seen = {"gate_id": 3.0, "gate_x": 2.0, "gate_y": 0.5, "gate_heading": 0.5, "gate_age": 0.0}
        for driven in (0.0, 0.3, 0.6, 0.6):
            steering, _ = bench.tick(distance=driven, **seen)
        assert bench.active == "b"
        assert steering == pytest.approx(1.0)

    def test_a_condition_has_no_target_before_one_was_handed_over(self) -> None:
        bench = two_states({"type": "ArucoGateFound", "target": True, "hand_over": False})
        bench.see(**GATE)
        assert bench.active == "a"

    def test_a_target_of_one_post_stays_where_it_was_guessed(self) -> None:
        post = {"marker_id": 0.0, "marker_x": 1.0, "marker_y": 0.9, "marker_heading": 0.3, "marker_age": 0.0}
        bench = two_states(
            {"type": "ArucoGateFound", "one_post": True}, second={"type": "SCurve", "throttle": 0.2, "before": 0.0}
        )
        bench.see(**post)
        guessed = bench.command.target
        assert guessed is not None
        assert guessed.id == 0
        bench.see(**{**post, "marker_id": 2.0, "marker_x": 3.0, "marker_y": -0.5})
        assert bench.estimate.guessed_gate.id == 1
        target = bench.estimate.target_gate
        assert (target.id, target.x, target.y) == (guessed.id, guessed.x, guessed.y)

    def test_the_opening_of_the_target_tells_how_near_is_near_enough(self) -> None:
        bench = self.handed({"type": "Timer", "seconds": 9.0}, {"type": "Stop"})
        assert bench.estimate.gate.id == 1
        narrow = bench.estimate._replace(target_gate=bench.estimate.target_gate._replace(opening=0.76))
        assert bench.machine.active.aside(narrow) == pytest.approx(0.38 - 0.1 - 0.05)


class TestGoingToAState:
    """A policy that drives the car believes in another state than the machine."""

    def bench(self) -> Bench:
        states = [
            {"id": "look", "type": "Motor", "throttle": 0.2},
            {"id": "gate", "type": "SCurve", "speed": 0.45, "final": True},
        ]
        found = {"id": 0, "from": "look", "to": "gate", "type": "ArucoGateFound", "max_distance": 0.5}
        return Bench({"root": "look", "states": states, "transitions": [found]})

    def test_a_state_that_takes_a_target_gets_the_gate_that_is_known(self) -> None:
        bench = self.bench()
        bench.see(**GATE)
        assert bench.active == "look"
        bench.driver.go_to(1)
        assert bench.active == "gate"
        bench.tick(speed=0.4)
        assert bench.estimate.target_gate.id == 0
        assert bench.command.steering is not None
        assert bench.command.steering > 0.05  # the gate is to the left
        assert not bench.fired

    def test_without_a_gate_the_state_plans_its_own_way(self) -> None:
        bench = self.bench()
        bench.driver.go_to(1)  # before the first tick
        bench.tick(speed=0.4)
        assert bench.active == "gate"
        assert bench.estimate.target_gate.id == -1

    def test_a_state_to_which_nothing_leads_is_entered_too(self) -> None:
        bench = self.bench()
        bench.tick()
        for index, name in ((1, "gate"), (0, "look"), (0, "look")):
            bench.driver.go_to(index)
            assert bench.active == name
        assert bench.tick()[1] == 0.2
