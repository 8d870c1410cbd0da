"""What is wrong with a machine although each of its parts is right: found before it drives, all at once."""

import json
import time
from pathlib import Path
from typing import Any, ClassVar

import pytest

from tral_fsm import FormatError, MachineDefinition, MachinePolicy, check, load_machine
from tral_fsm.conditions.combined import AllSpec, AnySpec, NotSpec
from tral_fsm.conditions.gates import ArucoGateFoundSpec
from tral_fsm.conditions.simple import AlwaysSpec, DistanceSpec, FinishedSpec
from tral_fsm.definition import packaged
from tral_fsm.definition.machine import TransitionSpec
from tral_fsm.formats import library
from tral_fsm.formats.tral_json import loads
from tral_fsm.states.basic import MotorSpec, StopSpec
from tral_fsm.states.fsm_state import FSMStateSpec

STOP = {"id": 1, "type": "Stop"}
MOTOR = {"id": 0, "type": "Motor", "throttle": 0.2}
GO = {"id": 0, "type": "SensorLevel", "below": 0.5, "from": 0, "to": 1}
ALWAYS = {"type": "Always"}
NEVER = {"type": "Not", "of": [ALWAYS]}
NEAR = {"type": "SensorLevel", "below": 0.5}


def machine(*transitions: dict[str, Any], states: list[dict[str, Any]] | None = None) -> dict[str, Any]:
    return {"root": 0, "states": states or [MOTOR, STOP], "transitions": list(transitions)}


def way(number: int, source: int, target: int, **condition: Any) -> dict[str, Any]:
    return {"id": number, "from": source, "to": target, **condition}


def problems(raw: dict[str, Any]) -> dict[str, str]:
    with pytest.raises(FormatError) as caught:
        loads(json.dumps(raw))
    return {problem.pointer: problem.message for problem in caught.value.problems}


def is_good(raw: dict[str, Any]) -> bool:
    return isinstance(loads(json.dumps(raw)), MachineDefinition)


class TestAlwaysAndNever:
    @pytest.mark.parametrize(
        "condition",
        [
            ALWAYS,
            {"type": "Distance", "distance": 0},
            {"type": "Timer", "seconds": 0},
            {"type": "Any", "of": [NEAR, ALWAYS]},
            {"type": "All", "of": [ALWAYS, {"type": "Timer", "seconds": 0}]},
            {"type": "Not", "of": [NEVER]},
            {"type": "Not", "of": [{"type": "All", "of": [NEAR, NEVER]}]},
        ],
        ids=str,
    )
    def test_what_fires_always_shadows_what_is_checked_after_it(self, condition: dict[str, Any]) -> None:
        found = problems(machine(way(0, 0, 1, **condition), way(1, 0, 1, **NEAR)))
        assert found == {"/transitions/1": "transition 1 can never fire: 0, checked before it, fires always"}

    @pytest.mark.parametrize(
        "condition", [NEVER, {"type": "All", "of": [NEAR, NEVER]}, {"type": "Any", "of": [NEVER, NEVER]}], ids=str
    )
    def test_what_never_fires_is_told(self, condition: dict[str, Any]) -> None:
        found = problems(machine(way(0, 0, 1, **condition), way(1, 0, 1, **NEAR)))
        assert found == {"/transitions/0": "transition 0 can never fire: its condition holds in no tick"}

    @pytest.mark.parametrize(
        "condition",
        [
            NEAR,
            {"type": "Distance", "distance": 0.01},
            {"type": "Any", "of": [NEAR, NEVER]},
            {"type": "All", "of": [NEAR, ALWAYS]},
            {"type": "Not", "of": [NEAR]},
        ],
        ids=str,
    )
    def test_what_may_fire_or_not_is_neither(self, condition: dict[str, Any]) -> None:
        spec = loads(json.dumps(machine(way(0, 0, 1, **condition)))).transitions[0].when
        assert not spec.holds_always
        assert not spec.holds_never

    def test_the_same_condition_again_never_fires(self) -> None:
        found = problems(machine(way(0, 0, 1, **NEAR), way(1, 0, 1, **NEAR)))
        assert found == {"/transitions/1": "transition 1 can never fire: 0, checked before it, has the same condition"}

    def test_an_always_of_another_state_shadows_nothing(self) -> None:
        states = [MOTOR, {**MOTOR, "id": 2}, STOP]
        assert is_good(machine(way(0, 0, 2, **ALWAYS), way(1, 2, 1, **NEAR), states=states))


class TestWaysOut:
    def test_a_way_that_never_opens_is_none(self) -> None:
        assert "can never be left" in problems(machine(way(0, 0, 1, **NEVER)))["/states/0"]
        assert "cannot be reached" in problems(machine(way(0, 0, 1, **NEVER)))["/states/1"]

    def test_a_way_into_itself_is_none(self) -> None:
        found = problems({"root": 0, "states": [MOTOR], "transitions": [way(0, 0, 0, **NEAR)]})
        assert "state 0 (Motor) can never be left" in found["/states/0"]

    def test_a_final_state_may_stay(self) -> None:
        assert is_good({"root": 0, "states": [{**MOTOR, "final": True}], "transitions": []})


class TestZeroTimeCycles:
    STATES: ClassVar[list[dict[str, Any]]] = [{**MOTOR, "id": k} for k in range(3)]

    def test_a_circle_of_transitions_that_fire_at_once(self) -> None:
        ways = [
            way(0, 0, 1, **ALWAYS),
            way(1, 1, 2, type="Timer", seconds=0),
            way(2, 2, 1, type="Distance", distance=0),
        ]
        found = problems(machine(*ways, states=self.STATES))
        assert found == {"/transitions/1": "goes round in no time: 1 > 2 > 1, each left at once"}

    def test_an_always_into_itself(self) -> None:
        states = [{**MOTOR, "final": True}]
        assert problems(machine(way(0, 0, 0, **ALWAYS), states=states))["/transitions/0"].endswith(
            "0 > 0, each left at once"
        )

    def test_a_circle_that_waits_somewhere_is_none(self) -> None:
        ways = [way(0, 0, 1, **ALWAYS), way(1, 1, 2, **ALWAYS), way(2, 2, 0, type="Timer", seconds=0.1)]
        assert is_good(machine(*ways, states=self.STATES))

    def test_a_circle_that_a_transition_asked_before_leads_out_of_is_none(self) -> None:
        ways = [way(0, 0, 2, **NEAR), way(1, 0, 1, **ALWAYS), way(2, 1, 0, **ALWAYS)]
        assert is_good(machine(*ways, states=[MOTOR, {**MOTOR, "id": 1}, {"id": 2, "type": "Stop"}]))


class TestWhatConditionsAsk:
    def test_unreachable_needs_a_state_with_a_target(self) -> None:
        found = problems(machine(way(0, 0, 1, type="Unreachable")))
        assert "takes no target. Allowed: FollowWallRamp, ApproachPoint, SCurve" in found["/transitions/0/type"]

    def test_a_gate_that_is_not_seen_is_not_handed_over(self) -> None:
        assert is_good(machine(way(0, 0, 1, type="Not", of=[{"type": "ArucoGateFound"}])))

    def test_finished_on_an_inner_machine_without_an_end(self) -> None:
        loop = machine(way(0, 0, 1, **NEAR), way(1, 1, 0, **NEAR))
        states = [{"id": 0, "type": "FSMState", "machine": loop}, STOP]
        found = problems(machine(way(0, 0, 1, type="Finished"), states=states))
        assert "never says that it is finished: its machine has no state" in found["/transitions/0/type"]

    @pytest.mark.parametrize("ids", [[-1], [50]])
    def test_ids_of_no_marker(self, ids: list[int]) -> None:
        assert "/transitions/0/ids/0" in problems(machine(way(0, 0, 1, type="MarkerFound", ids=ids)))


class TestAllAtOnce:
    def test_parts_and_how_they_hang_together(self) -> None:
        raw = machine(
            way(0, 0, 7, **NEAR),
            way(1, 0, 1, type="Finished"),
            way(2, 0, 1, type="Nevver"),
            way(2, 3, 1, **NEAR),
            states=[MOTOR, STOP, {**MOTOR, "id": 1}, {"id": 3, "type": "Stopp"}, {**MOTOR, "id": 4, "steering": 2}],
        )
        assert set(problems(raw)) == {
            "/states/2/id",
            "/states/3/type",
            "/states/4/steering",
            "/transitions/0/to",
            "/transitions/1/type",
            "/transitions/2/type",
            "/transitions/3/id",
        }

    def test_nothing_is_said_of_a_state_whose_id_cannot_be_read(self) -> None:
        raw = machine(way(0, 0, 5, **NEAR), states=[MOTOR, {"type": "Stop"}])
        assert set(problems(raw)) == {"/states/1"}

    def test_inner_machines_have_their_pointers_in_the_whole_file(self) -> None:
        inner = machine(way(0, 0, 1, **ALWAYS), way(1, 0, 1, **NEAR), states=[MOTOR, {**MOTOR, "id": 1}])
        deep = {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": inner, "final": True}]}
        raw = {"root": 9, "states": [{"id": 0, "type": "FSMState", "machine": deep, "final": True}]}
        at = "/states/0/machine/states/0/machine"
        assert set(problems(raw)) == {"/root", f"{at}/transitions/1", f"{at}/states/1"}

    def test_a_definition_made_in_python_is_checked_the_same(self) -> None:
        states = (MotorSpec(id=0, throttle=0.1), StopSpec(id=1))
        when = AnySpec(of=(DistanceSpec(distance=1.0), NotSpec(of=(AlwaysSpec(),))))
        ways = (TransitionSpec(id=0, source=0, target=1, when=when),)
        assert check(MachineDefinition(root=0, states=states, transitions=ways)) == []
        lost = check(MachineDefinition(root=0, states=states, transitions=()))
        assert [p.pointer for p in lost] == ["/states/1", "/states/0"]


class TestNamedMachines:
    @staticmethod
    def packaged(monkeypatch: pytest.MonkeyPatch, **machines: Any) -> None:
        monkeypatch.setattr(packaged, "names", lambda: tuple(sorted(machines)))
        monkeypatch.setattr(packaged, "text", lambda name: json.dumps(machines[name]))
        monkeypatch.setattr(library, "by_name", library.by_name.__wrapped__)  # not kept for other tests

    @staticmethod
    def holding(name: str) -> dict[str, Any]:
        return {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": name, "final": True}]}

    def test_a_circle_of_names_is_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.packaged(monkeypatch, a=self.holding("b"), b=self.holding("c"), c=self.holding("b"))
        with pytest.raises(FormatError, match=r"/states/0/machine: .*holds itself: a > b > c > b"):
            load_machine("a")

    def test_the_same_machine_twice_side_by_side_is_no_circle(self, monkeypatch: pytest.MonkeyPatch) -> None:
        twice = self.holding("b")
        twice["states"] = [{**twice["states"][0], "id": k} for k in (0, 1)]
        twice["transitions"] = [way(0, 0, 1, **NEAR)]
        self.packaged(monkeypatch, a=twice, b={"root": 1, "states": [STOP]})
        assert load_machine("a").states[1].id == 1

    def test_finished_on_a_named_machine_without_an_end(self, monkeypatch: pytest.MonkeyPatch) -> None:
        outer = machine(way(0, 0, 1, type="Finished"), states=[{"id": 0, "type": "FSMState", "machine": "b"}, STOP])
        self.packaged(monkeypatch, a=outer, b=machine(way(0, 0, 1, **NEAR), way(1, 1, 0, **NEAR)))
        with pytest.raises(FormatError, match=r"/transitions/0/type: .*its machine has no state in which it may end"):
            load_machine("a")

    def test_a_name_in_an_inline_machine_has_its_pointer_in_the_whole_file(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        outer = {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": self.holding("bb"), "final": True}]}
        self.packaged(monkeypatch, a=outer, b={"root": 1, "states": [STOP]})
        with pytest.raises(
            FormatError, match="/states/0/machine/states/0/machine: got 'bb', which is no packaged machine"
        ):
            load_machine("a")

    def test_a_gate_handed_to_a_named_machine_whose_root_takes_none(self, monkeypatch: pytest.MonkeyPatch) -> None:
        states = [MOTOR, {"id": 1, "type": "FSMState", "machine": "b", "final": True}]
        outer = machine(way(0, 0, 1, type="ArucoGateFound"), states=states)
        self.packaged(monkeypatch, a=outer, b={"root": 1, "states": [STOP]})
        with pytest.raises(
            FormatError, match=r"1 problem\n.*/transitions/0/type: hands the gate to state 1 \(FSMState\)"
        ):
            load_machine("a")

    def test_in_a_definition_made_in_python_a_name_is_no_path(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        Path("wall.json").write_text(packaged.text("wall"))
        made = MachineDefinition(root=0, states=(FSMStateSpec(id=0, machine="./wall.json", final=True),))
        with pytest.raises(FormatError, match=r"got '\./wall\.json', which is no packaged machine"):
            MachinePolicy(made)

    def test_in_a_definition_made_in_python_each_problem_is_told_once(self) -> None:
        states = (MotorSpec(id=0, throttle=0.1), FSMStateSpec(id=1, machine="wal", final=True))
        ways = (TransitionSpec(id=0, source=0, target=1, when=FinishedSpec()),)
        with pytest.raises(FormatError) as caught:
            MachinePolicy(MachineDefinition(root=0, states=states, transitions=ways))
        assert [problem.pointer for problem in caught.value.problems] == ["/transitions/0/type", "/states/1/machine"]


class TestTargetsOfMachines:
    """A machine takes a target if its root does."""

    @staticmethod
    def outer(inner_root: dict[str, Any], **condition: Any) -> dict[str, Any]:
        inner = {"root": 0, "states": [{**inner_root, "id": 0, "final": True}]}
        states = [MOTOR, {"id": 1, "type": "FSMState", "machine": inner}, {"id": 2, "type": "Stop"}]
        return machine(way(0, 0, 1, type="ArucoGateFound"), way(1, 1, 2, **(condition or NEAR)), states=states)

    def test_the_root_may_take_it(self) -> None:
        raw = self.outer({"type": "ApproachPoint", "speed": 0.4}, type="Unreachable")
        assert is_good(raw)

    def test_a_root_that_takes_none_is_told(self) -> None:
        found = problems(self.outer({"type": "Motor", "speed": 0.4}, type="Unreachable"))
        assert set(found) == {"/transitions/0/type", "/transitions/1/type"}
        assert "an FSMState whose root is one of them" in found["/transitions/0/type"]


def test_many_transitions_of_a_state_are_checked_in_time_that_grows_with_their_number() -> None:
    ways = [way(k, 0, 1, type="Timer", seconds=k + 1.0) for k in range(500)]
    ways[-1]["seconds"] = 1.0
    start = time.process_time()
    found = problems(machine(*ways))
    assert found == {"/transitions/499": "transition 499 can never fire: 0, checked before it, has the same condition"}
    assert time.process_time() - start < 1.0


class TestWhatConditionsSayOfThemselves:
    GATE = ArucoGateFoundSpec()

    def test_a_gate_is_handed_over_by_what_is_combined_of_it(self) -> None:
        assert self.GATE.hands_over
        assert AllSpec(of=(self.GATE, AlwaysSpec())).hands_over
        assert not AllSpec(of=(AlwaysSpec(),)).hands_over

    def test_a_gate_that_is_not_seen_is_not_handed_over(self) -> None:
        assert not NotSpec(of=(self.GATE,)).hands_over
        assert not AnySpec(of=(NotSpec(of=(self.GATE,)), AlwaysSpec())).hands_over

    def test_a_gate_that_stays_is_not_handed_over(self) -> None:
        assert not ArucoGateFoundSpec(hand_over=False).hands_over

    def test_what_combines_others_names_its_parts(self) -> None:
        assert NotSpec(of=(self.GATE,)).parts == (self.GATE,)
        assert self.GATE.parts == ()

    def test_a_state_names_the_machine_that_it_holds(self) -> None:
        assert FSMStateSpec(id=0, machine="wall").inner == "wall"
        assert StopSpec(id=0).inner is None
