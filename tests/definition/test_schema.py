"""The JSON Schema of machine files: in step with the classes, and with what the reader takes."""

import copy
import json
from importlib.resources import files
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tral_fsm import FormatError, load_machine, machine_names
from tral_fsm.definition.conditions import CONDITIONS
from tral_fsm.definition.machine import STATES
from tral_fsm.definition.schema import dumps as schema_text
from tral_fsm.definition.schema import schema
from tral_fsm.formats.tral_json import as_json, dumps, loads

VALIDATOR = jsonschema.Draft202012Validator(schema())
STOP = {"id": 1, "type": "Stop"}


def fits(raw: Any) -> bool:
    return bool(VALIDATOR.is_valid(raw))


def test_the_committed_schema_is_that_of_the_classes() -> None:
    """If not: python -m tral_fsm.definition.schema > tral_fsm/machine.schema.json"""
    assert files("tral_fsm").joinpath("machine.schema.json").read_text("utf-8") == schema_text()


def test_it_is_a_schema_of_draft_2020_12() -> None:
    jsonschema.Draft202012Validator.check_schema(schema())


@pytest.mark.parametrize("name", machine_names())
def test_packaged_machines_fit_it(name: str) -> None:
    assert fits(as_json(load_machine(name)))


def test_every_type_and_parameter_stands_in_it_with_its_meaning() -> None:
    parts = schema()["$defs"]
    for kind, known in (("state", STATES), ("condition", CONDITIONS)):
        for name, spec in known.items():
            part = parts[f"{kind}.{name}"]
            assert set(part["properties"]) == {field.alias or key for key, field in spec.model_fields.items()}
            assert part["description"]
    assert parts["state.Motor"]["properties"]["speed"]["description"].endswith("[m/s]")


def test_a_transition_is_flat_as_in_files() -> None:
    part = schema()["$defs"]["transition.Distance"]
    assert set(part["properties"]) == {"id", "from", "to", "type", "distance"}
    assert set(part["required"]) == {"id", "from", "to", "type", "distance"}


@pytest.mark.parametrize(
    "state",
    [
        {"id": 0, "type": "Moter", "throttle": 0.1},
        {"id": 0, "type": "Motor"},
        {"id": 0, "type": "Motor", "throttle": 0.1, "speed": 0.5},
        {"id": 0, "type": "Motor", "throttle": 2},
        {"id": 0, "type": "Motor", "throttle": 0.1, "colour": "red"},
        {"type": "Motor", "throttle": 0.1},
        {"id": "", "type": "Stop"},
        {"id": 0, "type": "FollowWall", "throttle": 0.1, "slow_front": 1.0},
    ],
    ids=str,
)
def test_it_refuses_what_the_reader_refuses(state: dict[str, Any]) -> None:
    raw = {"root": 1, "states": [STOP, {**state, "final": True}]}
    assert not fits(raw)
    with pytest.raises(FormatError):
        loads(json.dumps(raw))


def test_a_parameter_given_as_null_is_not_given() -> None:
    raw = {"root": 0, "states": [{"id": 0, "type": "Motor", "throttle": 0.1, "speed": None, "final": True}]}
    assert fits(raw)
    assert loads(json.dumps(raw)).states[0].final


def test_a_file_may_name_its_schema_at_the_top_alone() -> None:
    raw = {"$schema": "machine.schema.json", "root": 1, "states": [STOP]}
    assert fits(raw)
    assert "$schema" not in dumps(loads(json.dumps(raw)))
    inner = {"root": 0, "states": [{"id": 0, "type": "FSMState", "machine": raw, "final": True}]}
    assert not fits(inner)
    with pytest.raises(FormatError, match=r"/states/0/machine/\$schema"):
        loads(json.dumps(inner))


GATE = as_json(load_machine("gate"))
junk = st.none() | st.booleans() | st.integers(-2, 60) | st.floats(-2, 8) | st.sampled_from(["", "left", "Motor"])


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_what_the_reader_takes_the_schema_takes(data: st.DataObject) -> None:
    raw = copy.deepcopy(GATE)
    kind = data.draw(st.sampled_from(["states", "transitions"]))
    part = raw[kind][data.draw(st.integers(0, len(raw[kind]) - 1))]
    known = STATES if kind == "states" else CONDITIONS
    if part["type"] in known:
        fields = [field.alias or name for name, field in known[part["type"]].model_fields.items()]
        part[data.draw(st.sampled_from(fields))] = data.draw(junk)
    try:
        loads(json.dumps(raw))
    except FormatError:
        return
    assert fits(raw)
