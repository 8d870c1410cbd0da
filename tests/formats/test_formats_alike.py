"""All formats give the same definition, and lose nothing."""

import json
import re

import pytest
from any_machine import machines
from hypothesis import HealthCheck, given, settings
from to_json import xml2json

from tral_fsm import MachineDefinition, load_machine, machine_names
from tral_fsm.definition.conditions import CONDITIONS
from tral_fsm.definition.machine import STATES
from tral_fsm.formats import FORMATS, read, write
from tral_fsm.formats.tral_json import as_json

THERE_AND_BACK = [name for name, entry in FORMATS.items() if entry.reads and entry.writes]


def again(machine: MachineDefinition, name: str) -> MachineDefinition:
    if name == "xml2json":
        return read(xml2json(write(machine, "uxf")), "again")
    return read(write(machine, name), "again")


def test_the_formats_that_are_read_and_written() -> None:
    assert THERE_AND_BACK == ["json", "uxf", "scxml"]


@pytest.mark.parametrize("machine", machine_names())
@pytest.mark.parametrize("name", [*THERE_AND_BACK, "xml2json"])
def test_every_packaged_machine_is_the_same_in_every_format(name: str, machine: str) -> None:
    definition = load_machine(machine)
    assert again(definition, name) == definition


@pytest.mark.parametrize("machine", machine_names())
def test_ends_of_written_arrows_are_where_they_are_drawn(machine: str) -> None:
    text, count = re.subn(r'^"(from|to)": .*\n', "", write(load_machine(machine), "uxf"), flags=re.MULTILINE)
    assert count == 2 * len(load_machine(machine).transitions)
    assert read(text, "drawn") == load_machine(machine)


@pytest.mark.parametrize("name", [*THERE_AND_BACK, "xml2json"])
def test_round_trips_lose_nothing(name: str) -> None:
    seen: set[str] = set()

    @settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
    @given(machines())
    def lose_nothing(machine: MachineDefinition) -> None:
        assert again(machine, name) == machine
        text = json.dumps(as_json(machine))
        seen.update(kind for kind in (*STATES, *CONDITIONS) if f'"type": "{kind}"' in text)

    lose_nothing()
    assert len(seen) > 0.8 * (len(STATES) + len(CONDITIONS))
