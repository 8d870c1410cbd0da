"""An error in the code of a state or a condition of one's own names its place in the machine and in the file."""

from collections.abc import Iterator
from typing import Literal

import pytest
from readings import Bench

from tral_env.errors import MachineError, MachineRunError, PolicyError
from tral_fsm.conditions import base as conditions
from tral_fsm.control.command import Command
from tral_fsm.definition.conditions import CONDITIONS, ConditionSpec
from tral_fsm.definition.machine import STATES, StateSpec
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states import base as states


class WeaveSpec(StateSpec):
    type: Literal["Weave"] = "Weave"
    breaks_in: str = ""


class Weave(states.State[WeaveSpec]):
    def __init__(self, spec: WeaveSpec) -> None:
        super().__init__(spec)
        self.break_in("init")

    def on_enter(self, estimate: CarEstimate) -> None:
        self.break_in("on_enter")

    def tick(self, estimate: CarEstimate) -> Command:
        self.break_in("tick")
        return Command(speed=0.5)

    def on_exit(self, estimate: CarEstimate) -> None:
        self.break_in("on_exit")

    def break_in(self, method: str) -> None:
        if self.spec.breaks_in == method:
            raise ZeroDivisionError("division by zero\nand more")


class MoodSpec(ConditionSpec):
    type: Literal["Mood"] = "Mood"
    breaks_in: str = ""


class Mood(conditions.Condition[MoodSpec]):
    def on_enter(self, estimate: CarEstimate) -> None:
        self.break_in("on_enter")

    def triggered(self, estimate: CarEstimate) -> bool:
        self.break_in("triggered")
        return True

    def why(self, estimate: CarEstimate) -> str:
        self.break_in("why")
        return "in the mood"

    def hand_over(self, estimate: CarEstimate) -> Detection | None:
        self.break_in("hand_over")
        return None

    def restart(self) -> None:
        self.break_in("restart")

    def break_in(self, method: str) -> None:
        if self.spec.breaks_in == method:
            raise ValueError("not today")


@pytest.fixture(autouse=True)
def own_types() -> Iterator[None]:
    states.register(Weave)
    conditions.register(Mood)
    yield
    STATES.unregister("Weave")
    CONDITIONS.unregister("Mood")


def bench(state: str = "", condition: str = "") -> Bench:
    return Bench(
        {
            "root": 0,
            "states": [{"id": 0, "type": "Weave", "breaks_in": state}, {"id": 1, "type": "Stop"}],
            "transitions": [{"id": 3, "from": 0, "to": 1, "type": "Mood", "breaks_in": condition}],
        }
    )


@pytest.mark.parametrize("method", ["on_enter", "tick", "on_exit"])
def test_a_state_is_named_with_its_time_and_the_line_of_its_file(method: str) -> None:
    with pytest.raises(MachineRunError) as caught:
        bench(state=method).tick()
    told = str(caught.value)
    line = told.removesuffix(")").rsplit(" ", 1)[1]
    assert told == (
        f"state 0 (Weave) failed at 0.01 s: ZeroDivisionError: division by zero (test_failures.py, line {line})"
    )
    assert int(line) > 20
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


@pytest.mark.parametrize("method", ["on_enter", "triggered", "why", "hand_over"])
def test_a_condition_is_named_with_its_transition(method: str) -> None:
    told = (
        r"transition 3 \(Mood\) from state 0 failed at 0\.01 s: ValueError: not today \(test_failures\.py, line \d+\)"
    )
    with pytest.raises(MachineRunError, match=f"^{told}$"):
        bench(condition=method).tick()


def test_what_fails_before_the_first_tick_says_when() -> None:
    with pytest.raises(MachineRunError, match=r"^state 0 \(Weave\) failed when it was built: ZeroDivisionError"):
        bench(state="init")
    with pytest.raises(MachineRunError, match=r"^transition 3 \(Mood\) from state 0 failed when it was restarted: "):
        bench(condition="restart")


def test_a_state_in_an_inner_machine_is_named_once_with_its_path() -> None:
    inner = {"root": "in", "states": [{"id": "in", "type": "Weave", "breaks_in": "tick", "final": True}]}
    outer = Bench({"root": 7, "states": [{"id": 7, "type": "FSMState", "machine": inner, "final": True}]})
    with pytest.raises(MachineRunError, match=r"^state 7/in \(Weave\) failed at 0\.01 s: ZeroDivisionError: "):
        outer.tick()


def test_a_failure_is_an_error_of_a_machine_and_of_a_policy() -> None:
    assert issubclass(MachineRunError, MachineError)
    assert issubclass(MachineRunError, PolicyError)
