"""JSON Schema of a machine file, built from the definition's classes, so that an editor completes and checks it.

`tral_fsm/machine.schema.json` is its text; `python -m tral_fsm.definition.schema` prints it, with the types of plugins
that are installed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from tral_fsm.definition.conditions import CONDITIONS, ConditionSpec
from tral_fsm.definition.machine import STATES, MachineDefinition, StateSpec
from tral_fsm.definition.validated import Spec

URL = "https://json-schema.org/draft/2020-12/schema"
_ID = {"type": ["integer", "string"], "minLength": 1, "description": "a number or a word, each once"}


def schema(
    states: Mapping[str, type[StateSpec]] = STATES, conditions: Mapping[str, type[ConditionSpec]] = CONDITIONS
) -> dict[str, Any]:
    """The schema, draft 2020-12.

    Args:
        states: types of states by name.
        conditions: types of conditions by name.

    Returns:
        Plain JSON values. Reading a file refuses all that the schema refuses, but parameters of earlier versions
        (`Spec.former`), and also checks how the parts fit together.
    """
    parts: dict[str, Any] = {"id": _ID}
    for name, state in states.items():
        parts[f"state.{name}"] = _part(state, name)
    for name, condition in conditions.items():
        parts[f"condition.{name}"] = _part(condition, name)
        parts[f"transition.{name}"] = _transition(condition, name)
    parts["state"] = _one_of("state", states)
    parts["transition"] = _one_of("transition", conditions)
    parts["condition"] = _one_of("condition", conditions)
    parts["machine"] = _machine()
    top = _machine()
    top["properties"] = {"$schema": {"type": "string"}, **top["properties"]}
    return {"$schema": URL, "title": "TRAL state machine", **top, "$defs": parts}


def dumps() -> str:
    """The schema as text."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def _one_of(kind: str, known: Mapping[str, Any]) -> dict[str, Any]:
    """One of the types, told apart by "type"."""
    return {
        "type": "object",
        "required": ["type"],
        "properties": {"type": {"enum": list(known)}},
        "oneOf": [_ref(f"{kind}.{name}") for name in known],
    }


def _machine() -> dict[str, Any]:
    fields = MachineDefinition.model_fields
    return {
        "type": "object",
        "description": _first_line(MachineDefinition),
        "properties": {
            "name": {"type": "string"},
            "description": {"type": "string"},
            "root": {**_ref("id"), "description": fields["root"].description},
            "states": {"type": "array", "minItems": 1, "items": _ref("state")},
            "transitions": {
                "type": "array", "items": _ref("transition"), "description": "in the order in which they are checked",
            },
        },
        "required": ["root", "states"],
        "additionalProperties": False,
    }  # fmt: skip


def _part(spec: type[Spec], name: str) -> dict[str, Any]:
    """One type of state or condition."""
    raw = spec.model_json_schema(by_alias=True)
    properties = {key: _property(key, value, raw.get("$defs", {})) for key, value in raw["properties"].items()}
    properties["type"] = {"const": name}
    if "id" in properties:
        properties["id"] = _ref("id")
    if "of" in properties:
        properties["of"]["items"] = _ref("condition")
    if issubclass(spec, StateSpec) and spec.holds_machine:
        properties["machine"] = {
            "description": properties["machine"]["description"], "anyOf": [_ref("machine"), {"type": "string"}],
        }  # fmt: skip
    required = ["type", *(key for key in raw.get("required", ()) if key != "type")]
    return {
        "type": "object",
        "description": _first_line(spec),
        "properties": properties,
        "required": required,
        "additionalProperties": False,
        **_rules(spec),
    }


def _transition(spec: type[ConditionSpec], name: str) -> dict[str, Any]:
    """A type of condition with its ends beside it, as a transition stands in a file."""
    part = _part(spec, name)
    ends = {
        "id": _ref("id"),
        "from": {**_ref("id"), "description": "the state that is left"},
        "to": {**_ref("id"), "description": "the state that is entered"},
    }
    return {
        **part, "properties": {**ends, **part["properties"]}, "required": [*ends, *part["required"]],
    }  # fmt: skip


def _rules(spec: type[Spec]) -> dict[str, Any]:
    """What parameters demand of each other."""
    rules: dict[str, Any] = {}
    if spec.exactly_one:
        rules["oneOf"] = [_given(name) for name in spec.exactly_one]
    if spec.needs:
        rules["allOf"] = [{"if": _given(name), "then": _given(other)} for name, other in spec.needs.items()]
    return rules


def _given(name: str) -> dict[str, Any]:
    return {"required": [name], "properties": {name: {"not": {"type": "null"}}}}


def _property(key: str, value: dict[str, Any], defs: Mapping[str, Any]) -> dict[str, Any]:
    """A parameter without its title, with its unit in the description and its references resolved."""
    value = {name: part for name, part in value.items() if name not in ("title",)}
    if "$ref" in value:
        value = {**defs[value.pop("$ref").rpartition("/")[2]], **value}
    unit = value.pop("unit", "")
    value.pop("null", "")
    if unit:
        value["description"] = f"{value.get('description', '')} [{unit}]"
        value["unit"] = unit
    return value


def _ref(name: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{name}"}


def _first_line(spec: type[Spec]) -> str:
    return (spec.__doc__ or "").strip().partition("\n")[0]


if __name__ == "__main__":  # Python has imported the package `tral_fsm` before, which registers the built-in types
    from tral_fsm.definition.plugins import load_plugins

    load_plugins()
    print(dumps(), end="")
