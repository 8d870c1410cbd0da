"""How a machine ticks: the rules of docs/state_machine.md."""

import math
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from readings import Bench, one_state, two_states

from tral_env.errors import MachineError
from tral_env.interface import CORE_LAYOUT
from tral_fsm import FormatError
from tral_fsm.conditions import base as conditions
from tral_fsm.control.command import IDLE, Command
from tral_fsm.definition import packaged
from tral_fsm.definition.conditions import CONDITIONS, ConditionSpec
from tral_fsm.definition.machine import STATES, StateSpec
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.estimation.estimator import Estimator
from tral_fsm.estimation.readings import Readings
from tral_fsm.formats import library
from tral_fsm.formats.library import load
from tral_fsm.states import base as states
from tral_fsm.states.basic import Motor, Stop
from tral_fsm.states.fsm_state import FSMState


def motor(number: int, throttle: float) -> dict[str, object]:
    return {"id": number, "type": "Motor", "throttle": throttle}


def way(number: int, source: int, target: int, **condition: object) -> dict[str, object]:
    return {"id": number, "from": source, "to": target, **condition}


class TestTickOrder:
    def test_the_root_is_entered_at_the_first_tick(self) -> None:
        bench = two_states({"type": "Distance", "distance": 1.0})
        bench.tick(distance=7.0)
        bench.tick(distance=7.5)
        assert bench.active == "a"

    def test_the_output_of_a_tick_is_that_of_the_old_state(self) -> None:
        bench = Bench({"root": 0, "states": [motor(0, 0.1), motor(1, 0.2)], "transitions": [
            way(0, 0, 1, type="Always"), way(1, 1, 0, type="Distance", distance=9.0)]})  # fmt: skip
        assert [bench.tick()[1] for _ in range(2)] == [0.1, 0.2]

    def test_the_first_transition_that_has_triggered_is_taken(self) -> None:
        bench = Bench({"root": 0, "states": [motor(0, 0.1), motor(1, 0.2), {"id": 2, "type": "Stop"}], "transitions": [
            way(0, 0, 1, type="SensorLevel", below=0.5), way(1, 0, 2, type="Always"), way(2, 1, 0, type="Always"),
        ]})  # fmt: skip
        bench.tick(front=0.4)
        assert bench.active == "1"

    def test_one_transition_a_tick(self) -> None:
        bench = Bench({"root": 0, "states": [motor(0, 0.1), motor(1, 0.2), {"id": 2, "type": "Stop"}], "transitions": [
            way(0, 0, 1, type="Always"), way(1, 1, 2, type="Always")]})  # fmt: skip
        names = []
        for _ in range(3):
            bench.tick()
            names.append(bench.active)
        assert names == ["1", "2", "2"]

    def test_a_transition_into_the_same_state_enters_it_anew(self) -> None:
        again = way(0, 0, 0, type="Distance", distance=1)
        bench = Bench({"root": 0, "states": [{**motor(0, 0.1), "final": True}], "transitions": [again]})
        for distance in (0.0, 1.0, 1.5, 2.0):
            bench.tick(distance=distance)
        assert [round(t.time / 0.0125) for t in bench.fired] == [2, 4]

    def test_a_transitions_memory_starts_anew_when_its_state_is_entered(self) -> None:
        bench = Bench({"root": 0, "states": [motor(0, 0.1), motor(1, 0.1)], "transitions": [
            way(0, 0, 1, type="Distance", distance=1.0), way(1, 1, 0, type="Distance", distance=0.5)]})  # fmt: skip
        names = []
        for distance in (0.0, 1.0, 1.5, 2.0, 2.5):
            bench.tick(distance=distance)
            names.append(bench.active)
        assert names == ["0", "1", "0", "0", "1"]


class TestEntryAndExit:
    def test_exit_of_the_old_state_comes_before_entry_of_the_new(self, monkeypatch: pytest.MonkeyPatch) -> None:
        calls: list[str] = []
        for kind in (Motor, Stop):
            for hook in ("on_enter", "tick", "on_exit"):
                name = f"{kind.__name__}.{hook}"
                monkeypatch.setattr(kind, hook, lambda self, estimate, name=name: calls.append(name) or IDLE)
        bench = two_states({"type": "Always"})
        bench.tick()
        bench.tick()
        assert calls == ["Motor.on_enter", "Motor.tick", "Motor.on_exit", "Stop.on_enter", "Stop.tick"]

    def test_inner_and_outer_in_one_tick_the_inner_moves_first_and_is_then_left(self) -> None:
        inner = {"root": 0, "states": [motor(0, 0.1), motor(1, 0.2)], "transitions": [
            way(0, 0, 1, type="Distance", distance=1.0), way(1, 1, 0, type="Distance", distance=1.0)]}  # fmt: skip
        states = [{"id": 0, "type": "FSMState", "machine": inner}, {"id": 1, "type": "Stop"}]
        bench = Bench({"root": 0, "states": states, "transitions": [way(0, 0, 1, type="Distance", distance=1.0)]})
        bench.tick(distance=0.0)
        bench.tick(distance=1.0)
        assert [t.path for t in bench.fired] == [(0,), ()]
        assert bench.active == "1"


class TestMachinesInMachines:
    """Two of them: "a" holds one that goes on by distance, "b" is a motor."""

    INNER: ClassVar[dict[str, Any]] = {
        "root": 0,
        "states": [motor(0, 0.1), motor(1, 0.2)],
        "transitions": [way(0, 0, 1, type="Distance", distance=1.0), way(1, 1, 0, type="Distance", distance=9.0)],
    }

    def outer(self, *ways: dict[str, object]) -> Bench:
        states = [{"id": "a", "type": "FSMState", "machine": self.INNER, "final": True}, {**motor(0, 0.3), "id": "b"}]
        far = [{"id": f"{a} far", "from": a, "to": b, "type": "Distance", "distance": 99.0} for a, b in ("ab", "ba")]
        return Bench({"root": "a", "states": states, "transitions": [*ways, *far]})

    def test_the_outer_transitions_are_asked_though_the_inner_one_has_fired(self) -> None:
        bench = self.outer(
            {"id": "out", "from": "a", "to": "b", "type": "Distance", "distance": 1.0},
            {"id": "in", "from": "b", "to": "a", "type": "Distance", "distance": 1.0},
        )
        bench.tick(distance=0.0)
        # the output of that tick is that of the state that was active when it began
        assert bench.tick(distance=1.0) == (0.0, 0.1)
        assert bench.active == "b"

    def test_on_return_it_starts_at_its_root_with_conditions_anew(self) -> None:
        bench = self.outer(
            {"id": "out", "from": "a", "to": "b", "type": "SensorLevel", "below": 0.5},
            {"id": "in", "from": "b", "to": "a", "type": "SensorLevel", "above": 0.5},
        )
        bench.tick(distance=0.0, front=1.0)
        bench.tick(distance=1.0)
        assert bench.active == "a/1"
        bench.tick(front=0.4)
        bench.tick(front=1.0)
        assert bench.active == "a/0"
        bench.tick(distance=1.9)
        assert bench.active == "a/0"
        bench.tick(distance=2.0)
        assert bench.active == "a/1"

    def test_a_transition_into_itself_starts_the_inner_machine_anew(self) -> None:
        bench = self.outer({"id": "again", "from": "a", "to": "a", "type": "Distance", "distance": 1.5})
        names = []
        for distance in (0.0, 1.0, 1.5, 2.4, 2.5):
            bench.tick(distance=distance)
            names.append(bench.active)
        assert names == ["a/0", "a/1", "a/0", "a/0", "a/1"]

    def test_leaving_it_leaves_the_inner_state_first(self, monkeypatch: pytest.MonkeyPatch) -> None:
        calls: list[str] = []
        leave = FSMState.on_exit

        def outer_exit(self: FSMState, estimate: CarEstimate) -> None:
            leave(self, estimate)
            calls.append("outer")

        monkeypatch.setattr(Motor, "on_exit", lambda self, estimate: calls.append(f"inner {self.spec.id}"))
        monkeypatch.setattr(FSMState, "on_exit", outer_exit)
        bench = self.outer({"id": "out", "from": "a", "to": "b", "type": "Timer", "seconds": 0.0125},
                           {"id": "in", "from": "b", "to": "a", "type": "Distance", "distance": 1.0})  # fmt: skip
        bench.tick()
        bench.tick()
        assert calls == ["inner 0", "outer"]

    @pytest.mark.parametrize("depth", [1, 2])
    def test_a_target_that_is_handed_over_goes_to_the_root(self, depth: int) -> None:
        def drive(second: dict[str, Any]) -> list[tuple[float, float]]:
            bench = two_states({"type": "ArucoGateFound"}, second=second)
            seen = {"gate_id": 3.0, "gate_x": 3.0, "gate_y": 0.4, "gate_heading": 0.1, "gate_age": 0.0}
            return [bench.tick(**seen), *(bench.tick(distance=0.01 * k, speed=0.8) for k in range(200))]

        alone = {"type": "ApproachPoint", "speed": 0.5}
        held = alone
        for _ in range(depth):
            held = {"type": "FSMState", "machine": {"root": 0, "states": [{**held, "id": 0, "final": True}]}}
        assert drive(held) == drive(alone)
        assert drive(held)[50][0] > 0.05

    def test_it_is_unreachable_when_its_active_state_says_so(self) -> None:
        inner = {"root": 0, "states": [{"id": 0, "type": "ApproachPoint", "x": 1.0, "speed": 0.5, "final": True}]}
        bench = two_states({"type": "Unreachable"}, first={"type": "FSMState", "machine": inner})
        bench.tick(distance=0.0)
        bench.tick(distance=0.9)
        assert bench.active == "a/0"
        bench.tick(distance=1.3)
        assert bench.active == "b"
        assert "behind" in bench.fired[0].why

    def test_after_a_restart_nothing_is_left_of_the_inner_machine(self) -> None:
        bench = self.outer()
        bench.tick(distance=0.0)
        bench.tick(distance=1.0)
        assert bench.active == "a/1"
        bench.reset()
        assert bench.active == "a/0"
        bench.tick(distance=5.0)
        assert bench.active == "a/0"

    def test_rows_that_are_reset_start_anew_and_the_others_go_on(self) -> None:
        from tral_fsm import MachinePolicy

        policy = MachinePolicy(self.outer().machine.definition)
        policy.reset(2)
        for distance in (0.0, 1.0):
            policy.act(CORE_LAYOUT.pack({"distance": distance}, 2))
        assert policy.active_states == ["a/1", "a/1"]
        policy.reset_rows(np.array([True, False]))
        assert policy.active_states == ["a/0", "a/1"]
        policy.act(CORE_LAYOUT.pack({"distance": 1.5}, 2))
        assert policy.active_states == ["a/0", "a/1"]


class TestEstimator:
    def test_it_takes_the_columns_of_the_contract(self) -> None:
        assert CORE_LAYOUT.names == Readings._fields
        row = [0.01 * k for k in range(len(Readings._fields))]
        r = Readings._make(row)
        ranges_and_ages = (r.ultrasonic_left, r.ultrasonic_front, r.ultrasonic_right,
                           r.ultrasonic_left_age, r.ultrasonic_front_age, r.ultrasonic_right_age)  # fmt: skip
        assert (*ranges_and_ages, r.distance, r.speed) == tuple(row[:8])
        assert (r.gate_age, r.marker_age, r.steering, r.throttle) == (row[12], row[17], row[18], row[19])
        estimate = Estimator().update(row)
        ranges = (estimate.left.range, estimate.front.range, estimate.right.range)
        assert (*ranges, estimate.distance, estimate.speed) == (*row[:3], row[6], row[7])
        assert (estimate.gate.age, estimate.marker.age) == (row[12], row[17])

    def test_a_reading_is_new_when_it_did_not_just_grow_older(self) -> None:
        estimator, news = Estimator(), []
        for age in (10.0, 10.0, 0.065, 0.0775, 0.09, 0.065, 0.0775):
            row = CORE_LAYOUT.missing(1)[0]
            row[CORE_LAYOUT.names.index("ultrasonic_left_age")] = age
            news.append(estimator.update(row.tolist()).left.new)
        assert news == [False, False, True, False, False, True, False]

    def test_a_sonars_interval_is_that_between_its_firings(self) -> None:
        estimator = Estimator()
        for age in (0.065, 0.0775, 0.09, 0.1025, 0.115, 0.0525):
            row = CORE_LAYOUT.missing(1)[0]
            row[CORE_LAYOUT.names.index("ultrasonic_left_age")] = age
            estimate = estimator.update(row.tolist())
        # the second reading comes five ticks later, and is one tick fresher
        assert estimate.left.interval == pytest.approx(5 * 0.0125 + 0.0125)

    def test_a_straight_way_is_reckoned_straight(self) -> None:
        estimator = Estimator()
        for k in range(11):
            estimate = estimator.update(CORE_LAYOUT.pack({"distance": 0.1 * k, "speed": 0.5}, 1)[0].tolist())
        assert estimate.pose == pytest.approx((1.0, 0.0, 0.0))

    def test_a_pose_seen_from_here_and_back_is_the_same(self) -> None:
        estimate = CarEstimate(x=1.0, y=2.0, yaw=math.pi / 2)
        assert estimate.from_here((1.0, 3.0, math.pi / 2)) == pytest.approx((1.0, 0.0, 0.0))
        assert estimate.to_reckoning((1.0, 0.0, 0.0)) == pytest.approx((1.0, 3.0, math.pi / 2))

    def test_reverse_counts_backwards_once_the_car_has_stood(self) -> None:
        bench = two_states({"type": "Timer", "seconds": 100})
        bench.tick(distance=0.0, speed=0.0, throttle=-0.3)
        bench.tick(distance=0.1, speed=0.3, throttle=-0.3)
        assert bench.estimate.x == pytest.approx(-0.1)

    def test_a_car_that_does_not_start_gets_neutral_once_a_second(self) -> None:
        # after reverse gear the motor controller brakes until it has seen neutral for 100 ms
        bench = two_states({"type": "Timer", "seconds": 100}, {"type": "Motor", "speed": 0.5})
        neutral = [bench.tick(speed=0.0)[1] == 0.0 for _ in range(96)]
        assert neutral == [False] * 80 + [True] * 16
        assert bench.tick(speed=0.0)[1] > 0.0


class TestAxis:
    """A near gate tells which way the corridor leads."""

    @pytest.mark.parametrize(
        ("axis_deg", "distance", "believed"),
        [(21.0, 1.5, False), (23.0, 1.5, True), (-40.0, 1.5, True), (23.0, 2.5, False), (91.0, 1.5, False)],
        ids=["askew", "too far off", "to the other side", "far away", "across"],
    )
    def test_it_mends_a_wrong_direction_of_the_corridor(self, axis_deg: float, distance: float, believed: bool) -> None:
        bench = one_state(type="Motor", throttle=0.1)
        gate = {"gate_id": 0.0, "gate_x": distance, "gate_y": 0.0, "gate_heading": math.radians(axis_deg)}
        for _ in range(2):
            bench.tick(**gate, gate_age=0.0)
        expected = -axis_deg if believed else 0.0
        assert math.degrees(bench.estimate.heading) == pytest.approx(expected, abs=0.01)


class TestYourOwnState:
    def test_it_takes_ten_lines(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delitem(STATES, "Weave", raising=False)

        class WeaveSpec(StateSpec):
            type: Literal["Weave"] = "Weave"
            period: float = 2.0

        @states.register
        class Weave(states.State[WeaveSpec]):
            def tick(self, estimate: CarEstimate) -> Command:
                return Command(steering=math.sin(2 * math.pi * estimate.time / self.spec.period), speed=0.5)

        try:
            bench = Bench({"root": 0, "states": [{"id": 0, "type": "Weave", "period": 0.05, "final": True}]})
            assert [bench.tick()[0] for _ in range(4)] == pytest.approx([1.0, 0.0, -1.0, 0.0], abs=1e-9)
        finally:
            del STATES["Weave"], states.RUNTIMES["Weave"]

    def test_so_does_a_condition(self) -> None:
        class SpeedSpec(ConditionSpec):
            type: Literal["Speed"] = "Speed"
            above: float = 1.0

        @conditions.register
        class Speed(conditions.Condition[SpeedSpec]):
            def triggered(self, estimate: CarEstimate) -> bool:
                return estimate.speed > self.spec.above

        try:
            bench = two_states({"type": "Speed", "above": 0.5})
            bench.tick(speed=0.6)
            assert bench.active == "b"
        finally:
            del CONDITIONS["Speed"], conditions.RUNTIMES["Speed"]


class TestPackagedMachines:
    def test_an_unknown_name_is_answered_with_the_nearest(self) -> None:
        with pytest.raises(MachineError, match=r"'offise' is no packaged machine.*did you mean 'office'"):
            load("offise")

    def test_an_unknown_inner_machine_is_answered_with_the_nearest(self, tmp_path) -> None:  # type: ignore[no-untyped-def]
        path = tmp_path / "outer.json"
        path.write_text('{"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": "wal", "final": true}]}')
        with pytest.raises(
            FormatError, match=r"/states/0/machine: got 'wal', which is no packaged machine: did you mean 'wall'"
        ):
            load(path)

    def test_a_machine_that_holds_itself_is_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        held = '{"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": "wall", "final": true}]}'
        monkeypatch.setattr(packaged, "text", lambda name: held)
        monkeypatch.setattr(library, "by_name", library.by_name.__wrapped__)
        with pytest.raises(FormatError, match="holds itself: wall > wall"):
            load("wall")

    @pytest.mark.parametrize("name", ["x" * 5000, "x" * 5000 + ".json", "a\0b", "a\0b.json", ""])
    def test_what_can_be_no_name_of_a_file(self, name: str) -> None:
        with pytest.raises(MachineError):
            load(name)

    def test_a_file_that_is_not_there(self) -> None:
        with pytest.raises(MachineError, match=r"nowhere\.json: cannot be read"):
            load("nowhere.json")
