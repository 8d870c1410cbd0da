"""TRAL JSON: what is read, and everything that is wrong with a file at once."""

import json
import pickle
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_fsm import FormatError, load_machine, machine_names
from tral_fsm.definition.conditions import CONDITIONS
from tral_fsm.definition.machine import STATES
from tral_fsm.formats.library import load_with_notes
from tral_fsm.formats.tral_json import as_json, dumps, loads

STOP = {"id": 1, "type": "Stop"}
MOTOR = {"id": 0, "type": "Motor", "throttle": 0.2}
ALWAYS = {"id": 0, "type": "Always", "from": 0, "to": 1}


def machine(**changes: Any) -> dict[str, Any]:
    return {"root": 0, "states": [MOTOR, STOP], "transitions": [ALWAYS], **changes}


def problems(raw: Any) -> dict[str, str]:
    with pytest.raises(FormatError) as caught:
        loads(raw if isinstance(raw, str) else json.dumps(raw), "my.json")
    assert str(caught.value).startswith("my.json: ")
    return {problem.pointer: problem.message for problem in caught.value.problems}


def test_a_good_machine_has_its_parts() -> None:
    got = loads(json.dumps(machine()))
    assert (got.root, [state.type for state in got.states]) == (0, ["Motor", "Stop"])
    assert (got.transitions[0].source, got.transitions[0].target, got.transitions[0].when.type) == (0, 1, "Always")


def test_equal_machines_are_equal() -> None:
    assert loads(json.dumps(machine())) == loads(json.dumps(machine(), indent=3))
    assert loads(json.dumps(machine())) != loads(json.dumps(machine(states=[{**MOTOR, "throttle": 0.3}, STOP])))


@pytest.mark.parametrize("name", machine_names())
def test_packaged_machines_are_read_and_written_without_loss(name: str) -> None:
    definition = load_machine(name)
    assert loads(dumps(definition)) == definition
    assert definition.name == name


def test_the_reference_machines_are_there() -> None:
    assert {"wall", "corridor", "gate", "office"} <= set(machine_names())


def test_all_problems_are_told_at_once() -> None:
    bad = machine(
        states=[{**MOTOR, "speed": 99}, {"id": 1, "type": "Stopp"}],
        transitions=[{"id": 0, "type": "Always", "from": 0}, {**ALWAYS, "colour": "red"}],
    )
    assert set(problems(bad)) == {
        "/states/0/speed", "/states/0", "/states/1/type", "/transitions/0", "/transitions/1/colour",
    }  # fmt: skip


def test_a_misspelt_key_hides_no_other_value_and_is_told_once() -> None:
    bad = machine(states=[{"id": 0, "type": "Motor", "sped": 0.5, "steering": 7, "distance": "1"}, STOP])
    assert set(problems(bad)) == {"/states/0/sped", "/states/0/steering", "/states/0/distance"}


CASES: list[tuple[dict[str, Any], str, str]] = [
    (machine(states=[{**MOTOR, "type": "Moter"}, STOP]), "/states/0/type", "did you mean 'Motor'"),
    (machine(states=[{"id": 0}, STOP]), "/states/0/type", "got no type of state"),
    (machine(transitions=[{**ALWAYS, "type": "Allways"}]), "/transitions/0/type", "did you mean 'Always'"),
    (machine(states=[{**MOTOR, "sterring": 1}, STOP]), "/states/0/sterring", "did you mean 'steering'"),
    (machine(colour=1), "/colour", "unknown key 'colour'"),
    (machine(states=[{**MOTOR, "steering": 2}, STOP]), "/states/0/steering", "got 2: expected 1 or less"),
    (
        machine(states=[{**MOTOR, "steering": "1"}, STOP]),
        "/states/0/steering",
        'got "1": expected a number',
    ),
    (machine(states=[{**MOTOR, "id": True}, STOP]), "/states/0/id", "got true: expected a whole number or a word"),
    (machine(states=[{**MOTOR, "distance": 0}, STOP]), "/states/0/distance", "got 0: expected more than 0"),
    (machine(states=[{**MOTOR, "final": 1}, STOP]), "/states/0/final", "got 1: expected true or false"),
    (machine(states=[{**MOTOR, "label": 1}, STOP]), "/states/0/label", "got 1: expected a text"),
    (machine(transitions=[{**ALWAYS, "type": "All", "of": []}]), "/transitions/0/of", "got []: expected 1 or more"),
    (
        machine(transitions=[{**ALWAYS, "type": "Not", "of": [{"type": "Always"}] * 2}]),
        "/transitions/0/of",
        "got 2 of them: expected 1 or less",
    ),
    (
        {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": "./wall.json", "final": True}]},
        "/states/0/machine",
        "got './wall.json', which is no packaged machine",
    ),
    (
        {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": 3, "final": True}]},
        "/states/0/machine",
        "got 3: expected a machine or a name",
    ),
    (machine(states=[{"id": 0, "type": "Motor"}, STOP]), "/states/0", "neither of speed"),
    (machine(states=[{**MOTOR, "speed": 1}, STOP]), "/states/0", "both of speed"),
    (machine(states=[MOTOR, {**STOP, "id": 0}]), "/states/1/id", "got id 0, which /states/0 has already"),
    (machine(states=[MOTOR, {**STOP, "id": "0"}]), "/states/1/id", "got id '0', which /states/0 has already"),
    (machine(transitions=[ALWAYS, ALWAYS]), "/transitions/1/id", "got id 0, which /transitions/0 has already"),
    (machine(states=[{"type": "Motor", "throttle": 0}, STOP]), "/states/0", "the key 'id' is missing"),
    (machine(transitions=[{**ALWAYS, "to": 7}]), "/transitions/0/to", "got 7, which is no state: Allowed: 0, 1"),
    (machine(transitions=[{**ALWAYS, "from": "0"}]), "/transitions/0/from", "got '0', which is no state"),
    (machine(root=5), "/root", "got 5, which is no state"),
    ({"states": [STOP]}, "", "the key 'root' is missing"),
    (machine(states=[], transitions=[]), "/states", "got no state"),
    (machine(states=[MOTOR, STOP, {"id": 2, "type": "Stop"}]), "/states/2", "cannot be reached from the root"),
    (machine(transitions=[], states=[MOTOR]), "/states/0", "can never be left"),
    (machine(transitions=[{**ALWAYS, "type": "Finished"}]), "/transitions/0/type", "a Motor needs a distance"),
    (
        machine(transitions=[{**ALWAYS, "type": "ArucoGateFound"}]),
        "/transitions/0/type",
        "Allowed: FollowWallRamp",
    ),
    (machine(transitions=[ALWAYS, {**ALWAYS, "id": 1}]), "/transitions/1", "can never fire"),
    (
        machine(states=[{**MOTOR, "type": "FollowWall", "side": "rigth"}, STOP]),
        "/states/0/side",
        "did you mean 'right'",
    ),
    (
        machine(transitions=[{**ALWAYS, "type": "Not", "of": [{"type": "Finished"}]}]),
        "/transitions/0/of/0/type",
        "never says that it is finished",
    ),
    (machine(transitions=[{**ALWAYS, "type": "All", "of": [{"type": "Timer"}]}]), "/transitions/0/of/0", "'seconds'"),
    (machine(transitions=[{**ALWAYS, "type": "SensorLevel"}]), "/transitions/0", "neither of above"),
    (machine(states={}), "/states", "got {}, expected an array"),
    (machine(states=[3, STOP]), "/states/0", "got 3, expected an object"),
    (
        {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": {"root": 9, "states": [STOP]}, "final": True}]},
        "/states/0/machine/root",
        "got 9, which is no state",
    ),
]


@pytest.mark.parametrize(("raw", "pointer", "message"), CASES, ids=[f"{p} {m}" for _, p, m in CASES])
def test_each_problem_has_its_place_and_says_what_is_allowed(raw: dict[str, Any], pointer: str, message: str) -> None:
    found = problems(raw)
    assert pointer in found
    assert message in found[pointer]


def test_a_gate_need_not_be_handed_over() -> None:
    found = {**ALWAYS, "type": "ArucoGateFound", "hand_over": False}
    assert loads(json.dumps(machine(transitions=[found]))).transitions[0].when.type == "ArucoGateFound"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"root": 0,}', "not JSON: .* at line 1, column"),
        ("", "not JSON"),
        ('{"root": 0, "root": 0, "states": []}', "got the key 'root' twice"),
        ('{"root": NaN, "states": []}', "got NaN"),
        ("[" * 100_000, "nested too deeply"),
        ("9" * 10_000, "not readable"),
        ("3", "got 3, expected an object"),
    ],
)
def test_what_is_no_json_object(text: str, message: str) -> None:
    assert any(re.search(message, problem) for problem in problems(text).values())


def test_every_parameter_says_what_it_means() -> None:
    for specs in (STATES, CONDITIONS):
        for name, spec in specs.items():
            for key, field in spec.model_fields.items():
                if key not in ("type", "id"):
                    assert field.description, f"{name}.{key}"


leaves = st.none() | st.booleans() | st.integers(-3, 99) | st.floats() | st.sampled_from(["", "0", "Motor", "left"])
junk = (
    leaves | st.lists(leaves, max_size=2) | st.dictionaries(st.sampled_from(["id", "type", "of"]), leaves, max_size=2)
)


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_a_mutated_machine_gives_a_definition_or_a_format_error(data: st.DataObject) -> None:
    raw = as_json(load_machine("office"))
    for _ in range(data.draw(st.integers(1, 3))):
        part: Any = raw
        while isinstance(part, dict | list) and part and data.draw(st.booleans()):
            key = data.draw(st.sampled_from(sorted(part) if isinstance(part, dict) else range(len(part))))
            if not (isinstance(part[key], dict | list) and part[key]):
                break
            part = part[key]
        if isinstance(part, dict) and part:
            part[data.draw(st.sampled_from([*sorted(part), "x"]))] = data.draw(junk)
        elif isinstance(part, list) and part:
            part[data.draw(st.integers(0, len(part) - 1))] = data.draw(junk)
    text = json.dumps(raw)
    try:
        definition = loads(text)
    except FormatError:
        return
    assert loads(dumps(definition)) == definition


def test_a_format_error_comes_whole_out_of_another_process() -> None:
    with pytest.raises(FormatError) as caught:
        loads('{"root": 0, "states": []}', "a.json")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.problems) == (str(caught.value), caught.value.problems)


@pytest.mark.parametrize("value", [0.5, True, "0.1", None])
@pytest.mark.parametrize("state", ["FollowCorridor", "FollowWall", "BasicFollowWall", "FollowWallRamp"])
def test_a_parameter_of_an_earlier_version_is_read_and_noted(tmp_path: Path, state: str, value: object) -> None:
    told, untold = tmp_path / "told.json", tmp_path / "untold.json"
    drive = {"id": "drive", "type": state, "speed": 0.5, "final": True}
    untold.write_text(json.dumps({"root": "drive", "states": [drive]}))
    told.write_text(json.dumps({"root": "drive", "states": [{**drive, "learn_trim": value}]}))
    machine, notes = load_with_notes(told)
    assert (machine, ()) == load_with_notes(untold)
    assert notes == ("/states/0/learn_trim is of an earlier version and does nothing: delete it",)


def test_each_key_that_stands_twice_is_told_with_its_place() -> None:
    text = '{"root": 0, "states": [{"id": 0, "type": "Idle", "id": 1, "type": "Stop"}], "root": 1}'
    assert {"/root", "/states/0/id", "/states/0/type"} <= problems(text).keys()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"name": "x", "segments": []}', "a course, which `tral drive --course` takes, not a machine"),
        (
            '{"format": "x", "network": {}}',
            "the policy.json of a training, which `tral drive --policy` takes, not a machine",
        ),
    ],
)
def test_a_file_of_another_kind_is_named_in_one_line(text: str, told: str) -> None:
    with pytest.raises(FormatError) as error:
        loads(text)
    assert [problem.message for problem in error.value.problems] == [told]
