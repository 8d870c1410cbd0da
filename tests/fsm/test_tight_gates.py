"""Gates that are too close, beside the view, or one after the other, and what the machines pass them with."""

from typing import Any

import numpy as np
import pytest
from readings import Bench, two_states

from tral_env.course.layout import Course
from tral_env.interface import CONTROL_PERIOD_S
from tral_env.world import CorridorConfig, World
from tral_fsm import load_policy

GATE = {"gate_id": 0.0, "gate_x": 1.0, "gate_y": 0.2, "gate_heading": 0.0, "gate_age": 0.0}


def outcomes(machine: str, width: float, length: float, *gates: dict[str, Any], rows: int = 8) -> list[str]:
    """How drives of faulty cars end on a straight corridor with gates."""
    gates = tuple({"id": k, **gate} for k, gate in enumerate(gates))
    segment = {"length": length, "width": width, "gates": gates}
    course = Course.model_validate({"name": "tight", "segments": [segment]})
    world = World(rows, CorridorConfig(course=course))
    world.reset(np.arange(rows), [np.random.default_rng(seed) for seed in range(rows)])
    policy, driving = load_policy(machine), np.ones(rows, bool)
    policy.reset(rows)
    observation, ends = world.observation(), ["" for _ in range(rows)]
    while driving.any():
        step = world.step(policy.act(observation), np.flatnonzero(driving))
        observation = step.observation
        for row in np.flatnonzero(driving & (step.terminated | step.truncated)):
            info = {key: bool(step.info[key][row]) for key in ("success", "collision", "missed_gate")}
            ends[row] = next((key for key, holds in info.items() if holds), "time is up")
        driving &= ~(step.terminated | step.truncated)
    return ends


# The manoeuvre of 2016 drives its last metre straight on, whatever it sees then.
@pytest.mark.parametrize(("machine", "least"), [("gate_scurve", 8), ("gate", 6)])
def test_a_gate_so_close_that_only_one_post_is_in_view_is_passed(machine: str, least: int) -> None:
    ends = outcomes(machine, 3.0, 8.0, {"at": 2.5, "width": 0.6, "offset": 0.3})
    assert ends.count("success") >= least


@pytest.mark.parametrize("machine", ["gate_scurve", "gate"])
def test_a_gate_beside_the_view_is_passed(machine: str) -> None:
    ends = outcomes(machine, 3.0, 8.0, {"at": 3.0, "width": 0.8, "offset": 0.6})
    assert ends == ["success"] * 8


def test_gates_to_and_fro_are_mostly_passed() -> None:
    zigzag = [{"at": 4.0 + 3.3 * k, "width": 0.7, "offset": 0.7 * (-1) ** k} for k in range(3)]
    assert outcomes("gate_scurve", 2.6, 14.0, *zigzag).count("success") >= 6


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
    bench.tick(**post)
    for _ in range(20):
        bench.tick()
    bench.tick(gate_id=1.0, gate_x=1.5, gate_y=-0.42, gate_heading=0.0, gate_age=0.05, **post)
    assert bench.m.gates.target.id == -1
    for _ in range(80):
        bench.tick()
    assert (bench.m.gates.target.id, bench.m.gates.target.y) == (1, bench.m.gate.y)
    assert bench.active == "refused"


class TestAgain:
    """A car that is pushed from the first state to the second one, and back, as the distance grows."""

    def bench(self, **limits: object) -> Bench:
        forth = {"id": 0, "type": "Distance", "distance": 0.5, "from": "a", "to": "b"}
        end = {"id": 1, "type": "Again", "from": "b", "to": "end", **limits}
        back = {"id": 2, "type": "Distance", "distance": 0.1, "from": "b", "to": "a"}
        states = [{"id": i, "type": "Motor", "throttle": 0.2} for i in "ab"]
        return Bench(
            {"root": "a", "states": [*states, {"id": "end", "type": "Stop"}], "transitions": [forth, end, back]}
        )

    def driven(self, bench: Bench) -> float:
        """Way to the end; infinite: there is none within 10 m."""
        distance = 0.0
        while bench.active != "end" and distance < 10.0:
            bench.tick(distance=distance, speed=0.4)
            distance += 0.05
        return distance if bench.active == "end" else float("inf")

    def test_it_fires_at_the_second_entry(self) -> None:
        assert self.driven(self.bench()) == pytest.approx(1.2, abs=0.15)

    def test_farther_on_it_counts_anew(self) -> None:
        assert self.driven(self.bench(within=0.3)) == float("inf")

    def test_so_often_as_asked(self) -> None:
        assert self.driven(self.bench(times=3)) == pytest.approx(1.9, abs=0.2)

    def test_a_new_drive_counts_from_one(self) -> None:
        bench = self.bench()
        for distance in (0.0, 0.6):
            bench.tick(distance=distance, speed=0.4)
        fresh = self.bench()
        bench.m, bench.feed = fresh.m, fresh.feed
        bench.machine.restart()
        assert self.driven(bench) == pytest.approx(1.2, abs=0.15)


def test_unreachable_waits_until_it_has_held_long_enough_without_a_break() -> None:
    curve = {"type": "SCurve", "x": 1.0, "y": 1.0, "throttle": 0.2}
    bench = two_states({"type": "Unreachable", "seconds": 0.1}, curve)
    answers = ["far", "far", "", *["far"] * 20]
    ticks = 0
    bench.tick()
    bench.machine.active.unreachable = lambda m: answers[min(ticks, 22)]
    while bench.active == "a":
        ticks += 1
        bench.tick()
    assert ticks == 3 + 8  # 0.1 s after the break


class TestTheRoomInAGate:
    def seen(self, opening: float, y: float) -> Bench:
        """A gate one metre ahead whose middle is y to the left, beside a way straight on."""
        bench = two_states({"type": "ArucoGateFound", "missed_by": 0.1, "hand_over": False})
        marker = {"marker_id": 0.0, "marker_x": 1.0, "marker_y": y + (opening + 0.24) / 2, "marker_age": 0.0}
        bench.tick(**{**GATE, "gate_y": y}, **(marker if opening else {}))
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
    bench.tick(**far, marker_id=1.0, marker_x=2.0, marker_y=-0.3, marker_heading=0.0, marker_age=0.0)
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
        bench.tick(**GATE)
        bench.tick(gate_id=1.0, gate_x=5.0, gate_y=-1.0, gate_heading=-0.5, gate_age=0.0)
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
        bench.m.yaw += 0.1
        bench.tick()
        assert bench.active == "c"
        assert bench.m.gates.target.id == 0
        assert bench.m.steering == pytest.approx(1.0)

    def test_a_target_behind_the_car_is_done_with(self) -> None:
        bench = self.handed({"type": "Always"}, {"type": "ArucoGateCenter", "throttle": 0.2})
        assert bench.m.gates.target.id == 0
        bench.m.x += 2.0
        bench.machine.active.on_enter(bench.m)
        assert bench.m.gates.target.id == 1

    def test_where_none_was_handed_over_the_nearest_is_turned_to(self) -> None:
        bench = two_states({"type": "Distance", "distance": 0.5}, second={"type": "ArucoGateCenter", "throttle": 0.2})
        seen = {"gate_id": 3.0, "gate_x": 2.0, "gate_y": 0.5, "gate_heading": 0.5, "gate_age": 0.0}
        for driven in (0.0, 0.3, 0.6, 0.6):
            bench.tick(distance=driven, **seen)
        assert bench.active == "b"
        assert bench.m.steering == pytest.approx(1.0)

    def test_a_condition_has_no_target_before_one_was_handed_over(self) -> None:
        bench = two_states({"type": "ArucoGateFound", "target": True, "hand_over": False})
        bench.tick(**GATE)
        assert bench.active == "a"

    def test_a_target_of_one_post_stays_where_it_was_guessed(self) -> None:
        post = {"marker_id": 0.0, "marker_x": 1.0, "marker_y": 0.9, "marker_heading": 0.3, "marker_age": 0.0}
        bench = two_states(
            {"type": "ArucoGateFound", "one_post": True}, second={"type": "SCurve", "throttle": 0.2, "before": 0.0}
        )
        bench.tick(**post)
        target = bench.m.gates.target
        guessed = (target.id, target.x, target.y)
        assert guessed[0] == 0
        bench.tick(**{**post, "marker_id": 2.0, "marker_x": 3.0, "marker_y": -0.5})
        assert bench.m.guessed_gate.id == 1
        assert (target.id, target.x, target.y) == guessed

    def test_the_opening_of_the_target_tells_how_near_is_near_enough(self) -> None:
        bench = self.handed({"type": "Timer", "seconds": 9.0}, {"type": "Stop"})
        assert bench.m.gate.id == 1
        bench.m.gates.target.opening = 0.76
        assert bench.machine.active.aside(bench.m) == pytest.approx(0.38 - 0.1 - 0.05)
