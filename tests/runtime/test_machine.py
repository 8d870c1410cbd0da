"""How a machine ticks: the rules of docs/state_machine.md."""

import json
from typing import Any, ClassVar

import numpy as np
import pytest
from readings import Bench, two_states

from tral_env.errors import MachineError
from tral_env.interface import CONTROL_PERIOD_S, CORE_LAYOUT
from tral_fsm import Driver, Machine, load_machine
from tral_fsm.control.command import IDLE
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.formats.tral_json import loads
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
        assert [round(t.time / CONTROL_PERIOD_S) for t in bench.fired] == [2, 4]

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
        bench = self.outer({"id": "out", "from": "a", "to": "b", "type": "Timer", "seconds": CONTROL_PERIOD_S},
                           {"id": "in", "from": "b", "to": "a", "type": "Distance", "distance": 1.0})  # fmt: skip
        bench.tick()
        bench.tick()
        assert calls == ["inner 0", "outer"]

    @pytest.mark.parametrize("depth", [1, 2])
    def test_a_target_that_is_handed_over_goes_to_the_root(self, depth: int) -> None:
        def drive(second: dict[str, Any]) -> list[tuple[float, float]]:
            bench = two_states({"type": "ArucoGateFound"}, second=second)
            seen = {"gate_id": 3.0, "gate_x": 3.0, "gate_y": 0.4, "gate_heading": 0.1, "gate_age": 0.0}
            return [bench.see(**seen), *(bench.tick(distance=0.01 * k, speed=0.8) for k in range(200))]

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

    def test_a_packaged_one_comes_from_the_loader_that_is_given(self) -> None:
        held = {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": "wall", "final": True}]}
        definition = loads(json.dumps(held))
        with pytest.raises(MachineError, match=r"state 0 \(FSMState\) names the machine 'wall', and nothing loads it"):
            Machine(definition)
        assert Machine(definition, load=load_machine).active_path == Driver(definition).active_path

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
