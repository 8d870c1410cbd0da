"""TRAL JSON: `{"root": 0, "states": [{"id": 0, "type": ...}], "transitions": [{"id", "type", "from", "to", ...}]}`.

A transition's condition stands flat beside its id, from and to; combined conditions hold theirs in "of".
"""

from __future__ import annotations

import json
from typing import Any

from tral_env import json_text
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.machine import MachineDefinition, StateSpec
from tral_fsm.definition.validated import Spec
from tral_fsm.formats import units2016
from tral_fsm.formats.plain import MIN_PLAIN_STATES, Plain, Problems
from tral_fsm.formats.reader import definition


def loads(text: str, source: str = "machine") -> MachineDefinition:
    """Read and check a machine.

    Args:
        text: the JSON text.
        source: name of the file, for messages.

    Returns:
        The definition.

    Raises:
        FormatError: the text is no machine that can run; the error lists all problems.
    """
    problems = Problems()
    return definition(plain(parse(text, problems), problems), source, problems)


def dumps(machine: MachineDefinition) -> str:
    """Write a machine without the parameters that have their default."""
    return json.dumps(as_json(machine), indent=2, ensure_ascii=False) + "\n"


def parse(text: str, problems: Problems) -> Any:
    """Value of a JSON text; a repeated key, NaN and endless nesting are problems, and other text gives None."""

    def constant(name: str) -> float:
        problems.complain("", f"got {name}: numbers must be finite")
        return 0.0

    try:
        value, repeated = json_text.parse(text, constant)
    except json_text.NotJsonError as error:
        problems.complain("", str(error))
        return None
    for pointer in repeated:
        key = pointer.rpartition("/")[2]
        problems.complain(pointer, f"got the key {key!r} twice in one object: delete one of them")
    if isinstance(value, dict) and "states" not in value:
        other = next((told for key, told in _OTHER_FILES.items() if key in value), "")
        if other:
            problems.complain("", f"{other}, not a machine")
            return None
    return value


_OTHER_FILES = {
    "segments": "a course, which `tral drive --course` takes",
    "network": "the policy.json of a training, which `tral drive --policy` takes",
}
"""A key that no machine has, but a file of another kind -> what that file is."""


def plain(value: Any, problems: Problems) -> Plain:
    """Values of a TRAL JSON file; those of 2016 are converted to today's units."""
    states = value.get("states") if isinstance(value, dict) else None
    listed = [state for state in states if isinstance(state, dict)] if isinstance(states, list) else []
    if len(listed) >= MIN_PLAIN_STATES and not any("type" in state for state in listed):
        problems.plain_chart = (
            'a plain chart: no state has a "type". `tral fsm states` lists the types, and `tral fsm new my.json` '
            "writes a machine to begin with"
        )
    return Plain(units2016.modern(value, problems))


def as_json(machine: MachineDefinition) -> dict[str, Any]:
    """A machine as plain JSON values, as in a file."""
    whole: dict[str, Any] = {name: getattr(machine, name) for name in ("name", "description") if getattr(machine, name)}
    whole["root"] = machine.root
    whole["states"] = [state_json(state) for state in machine.states]
    whole["transitions"] = [
        {"id": t.id, "type": t.when.type, "from": t.source, "to": t.target, **members(t.when)}
        for t in machine.transitions
    ]
    return whole


def state_json(state: StateSpec) -> dict[str, Any]:
    """A state as plain JSON values, as in a file."""
    own = members(state)
    return {"id": own.pop("id"), "type": state.type, **own}


def condition_json(condition: ConditionSpec) -> dict[str, Any]:
    """A condition as plain JSON values, as a part of another one stands in a file."""
    return {"type": condition.type, **members(condition)}


def members(spec: Spec) -> dict[str, Any]:
    """Members of a part that differ from their defaults, as plain JSON values, without the type."""
    found = {}
    for name, field in type(spec).model_fields.items():
        value = getattr(spec, name)
        if name != "type" and (field.is_required() or value != field.default):
            found[name] = _plain(value)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, MachineDefinition):
        return as_json(value)
    if isinstance(value, ConditionSpec):
        return condition_json(value)
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
