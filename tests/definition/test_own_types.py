"""A state and a condition of one's own."""

import math
from typing import ClassVar, Literal

import pytest
from readings import Bench, two_states

from tral_env.errors import MachineError
from tral_fsm import load_machine
from tral_fsm.conditions import base as conditions
from tral_fsm.control.command import Command
from tral_fsm.definition.conditions import CONDITIONS, ConditionSpec
from tral_fsm.definition.machine import STATES, MachineDefinition, StateSpec, needed_readings
from tral_fsm.estimation.detections import NOTHING
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states import base as states
from tral_fsm.states.base import InnerMachine


class TestYourOwnState:
    def test_it_takes_ten_lines(self) -> None:
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
            STATES.unregister("Weave")

    @pytest.mark.parametrize(
        "answer",
        [
            None,
            (0.5, 1.0),
            Command(steering=math.nan),
            Command(speed=math.inf),
            Command(throttle=-math.inf),
            Command(throttle=0.2, steering_trim=math.nan),
            Command(wanted_side=math.inf),
            Command(wanted_clearance=math.inf),
            Command(target=NOTHING._replace(x=math.nan)),
            Command(steering="0.5"),  # type: ignore[arg-type]
        ],
    )
    def test_an_answer_that_is_no_command_names_state_type_and_time(self, answer: object) -> None:
        class MuteSpec(StateSpec):
            type: Literal["Mute"] = "Mute"

        @states.register
        class Mute(states.State[MuteSpec]):
            def tick(self, estimate: CarEstimate) -> Command:
                return answer if estimate.tick > 1 else Command(speed=0.5)  # type: ignore[return-value]

        try:
            inner = {"root": "quiet", "states": [{"id": "quiet", "type": "Mute", "final": True}]}
            bench = Bench({"root": 7, "states": [{"id": 7, "type": "FSMState", "machine": inner, "final": True}]})
            bench.tick()
            with pytest.raises(
                MachineError, match=r"state '7/quiet' \(Mute\) answered .* at 0\.0\d+ s: expected a Command"
            ):
                bench.tick()
        finally:
            STATES.unregister("Mute")

    def test_it_may_hold_a_machine(self) -> None:
        class LapsSpec(StateSpec):
            holds_machine: ClassVar[bool] = True
            type: Literal["Laps"] = "Laps"
            machine: MachineDefinition | str

        @states.register
        class Laps(states.State[LapsSpec]):
            """Begins its machine anew when it has ended."""

            def hold_machine(self, machine: InnerMachine) -> None:
                self.machine = machine

            def on_enter(self, estimate: CarEstimate) -> None:
                self.machine.start(estimate)

            def tick(self, estimate: CarEstimate) -> Command:
                if self.machine.ended:
                    self.machine.start(estimate)
                return self.machine.tick(estimate)

        go = {"id": 0, "type": "Motor", "throttle": 0.2}
        lap = {"root": 0, "states": [go, {"id": 1, "type": "Stop"}], "transitions": [
            {"id": "end", "type": "Distance", "distance": 1.0, "from": 0, "to": 1}]}  # fmt: skip
        try:
            bench = Bench({"root": "laps", "states": [{"id": "laps", "type": "Laps", "machine": lap, "final": True}]})
            assert [(bench.tick(distance=d)[1], bench.active) for d in (0.0, 1.0, 1.5, 2.5)] == [
                (0.2, "laps/0"), (0.2, "laps/1"), (0.2, "laps/0"), (0.2, "laps/1")]  # fmt: skip
            assert [transit.path for transit in bench.fired] == [("laps",)] * 2
            bench.reset()
            assert bench.active == "laps/0"
            named = Bench({"root": 0, "states": [{"id": 0, "type": "Laps", "machine": "wall", "final": True}]})
            assert {"ultrasonic_right"} < needed_readings(named.machine.definition, load_machine)
            assert named.tick(right=0.5)[1] > 0.0
        finally:
            STATES.unregister("Laps")

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
            CONDITIONS.unregister("Speed")
