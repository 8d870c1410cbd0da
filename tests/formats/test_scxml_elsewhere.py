"""Charts that we write, as a program that is not ours reads them: python-statemachine, which drops all namespaces."""

import json
from typing import Any

import pytest

from tral_fsm import MachineDefinition, load_machine, machine_names
from tral_fsm.formats import read, write
from tral_fsm.formats.scxml.reader import TAKEN

statemachine_io = pytest.importorskip("statemachine.io")

INNER = {
    "root": 1,
    "states": [{"id": 0, "type": "Stop", "final": True}, {"id": 1, "type": "Motor", "speed": 0.5, "distance": 1.0}],
    "transitions": [{"id": 0, "type": "Finished", "from": 1, "to": 0}],
}
NESTED = read(
    json.dumps(
        {
            "root": "outer",
            "states": [{"id": "outer", "type": "FSMState", "machine": INNER}, {"id": "rest", "type": "Stop"}],
            "transitions": [{"id": "done", "type": "Finished", "from": "outer", "to": "rest"}],
        }
    ),
    "nested",
)


def chart(machine: MachineDefinition) -> Any:
    return statemachine_io.load(write(machine, "scxml"), format="scxml")


def name(machine: MachineDefinition, state: Any) -> str:
    """The id of a state in a chart; one that is no XML id has a number."""
    index = [part.id for part in machine.states].index(state)
    return str(state) if isinstance(state, str) and " " not in state else f"s{index}"


@pytest.mark.parametrize("machine", machine_names())
def test_it_finds_every_state_and_transition(machine: str) -> None:
    ours = load_machine(machine)
    found = chart(ours)
    assert [state.id for state in found.states] == [name(ours, state.id) for state in ours.states]
    for state, mine in zip(found.states, ours.states, strict=True):
        ways = [(str(way.event or ""), way.target.id) for way in state.transitions]
        assert ways == [
            ("" if way.when.type == "Always" else way.when.type, name(ours, way.target))
            for way in ours.transitions
            if way.source == mine.id
        ]


@pytest.mark.parametrize("machine", machine_names())
def test_it_begins_in_the_root(machine: str) -> None:
    ours = load_machine(machine)
    assert list(chart(ours)().configuration_values) == [name(ours, ours.root)]


def test_it_enters_a_machine_inside_a_state_at_its_root_and_leaves_it_by_an_event() -> None:
    running = chart(NESTED)()
    assert list(running.configuration_values) == ["outer", "outer.s1"]
    running.send("Finished")
    assert "outer.s0" in running.configuration_values


@pytest.mark.parametrize("machine", [*map(load_machine, machine_names()), NESTED])
def test_no_name_of_ours_is_one_of_scxml(machine: MachineDefinition) -> None:
    text = write(machine, "scxml")
    assert "<tral:" not in text
    states = text.replace("<transition", "\n<transition")
    assert not [f for f in TAKEN if f != "type" and f" tral:{f}=" in states]
    assert not [line for line in states.splitlines() if line.startswith("<transition") and " tral:type=" in line]
