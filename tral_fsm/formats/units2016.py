"""Files of 2016: numbers in quotes, distances in hall units, transitions without ids.

Nothing in such a file tells metres from hall units, so `"units": "2016"` must say it. After the conversion the program
knows metres alone.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from typing import Any, get_args

from tral_env.errors import nearest
from tral_fsm.conditions import CONDITIONS
from tral_fsm.definition.validated import Spec
from tral_fsm.formats.plain import Problems
from tral_fsm.states import STATES

HALL_UNITS = 1500.0 / 1.60
"""Hall units of 2016 for a metre: 1500 were measured on 1.60 m."""
UNITS = ("SI", "2016")
"""Values of "units"; SI without it."""
IN_HALL_UNITS = {"FollowWallRamp": "distance", "Motor": "distance", "Distance": "distance"}
"""Type -> its parameter that was in hall units."""
NAMES = {"WandFolgen": "BasicFollowWall"}
"""Name of a type in 2016 -> its name now."""

_INTEGER = re.compile(r"-?\d{1,18}", re.ASCII)
_NUMBER = re.compile(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?\s*", re.ASCII)
"""A decimal number. Python's `float` would also take 1_0, inf and nan."""
_MAX_DEPTH = 40
"""Deepest nesting that is converted; the reader refuses deeper parts."""


def modern(value: Any, problems: Problems) -> Any:
    """A machine in today's units and without the member "units".

    Args:
        value: plain JSON values of a whole machine.
        problems: takes the problems of "units".

    Returns:
        A copy; it is converted if "units" is 2016.
    """
    if not isinstance(value, dict) or "units" not in value:
        return value
    units = value["units"]
    rest = {key: item for key, item in value.items() if key != "units"}
    if str(units) == "2016":
        return _machine(rest, 0)
    if units != "SI":
        problems.complain("/units", f"got {units!r}: {nearest(units, UNITS)}")
    return rest


def _machine(value: dict[str, Any], depth: int) -> dict[str, Any]:
    found = dict(value)
    for key, known in (("states", STATES), ("transitions", CONDITIONS)):
        if isinstance(found.get(key), list):
            found[key] = [_part(item, known, depth) for item in found[key]]
    if isinstance(found.get("transitions"), list):
        found["transitions"] = with_ids(found["transitions"])
    if "root" in found:
        found["root"] = _whole(found["root"])
    return found


def _part(item: Any, known: Mapping[str, type[Spec]], depth: int) -> Any:
    """A state or transition with numbers without quotes, and metres in place of hall units."""
    if not isinstance(item, dict) or depth > _MAX_DEPTH:
        return item
    found = {key: _whole(value) if key in ("id", "from", "to") else value for key, value in item.items()}
    name = found.get("type")
    if not isinstance(name, str):
        return found
    found["type"] = name = NAMES.get(name, name)
    if name in known:
        found = {key: _number(known[name], key, value) for key, value in found.items()}
    if isinstance(found.get("of"), list):
        found["of"] = [_part(inner, known, depth + 1) for inner in found["of"]]
    if isinstance(found.get("machine"), dict):
        found["machine"] = _machine(found["machine"], depth + 1)
    return found


def _number(spec: type[Spec], key: str, value: Any) -> Any:
    """Value of a parameter: a number without quotes, and metres in place of hall units."""
    field = spec.model_fields.get(key)
    if field is None or key in ("id", "label"):
        return value
    if isinstance(value, str) and _holds_number(field.annotation):
        if _INTEGER.fullmatch(value):
            value = int(value)
        elif _NUMBER.fullmatch(value):
            value = float(value)
    in_hall = IN_HALL_UNITS.get(str(spec.model_fields["type"].default)) == key
    return value / HALL_UNITS if in_hall and type(value) in (int, float) else value


def _holds_number(annotation: Any) -> bool:
    return annotation in (int, float) or any(part in (int, float) for part in get_args(annotation))


def _whole(value: Any) -> Any:
    """An id, as a number if it is one."""
    return int(value) if isinstance(value, str) and _INTEGER.fullmatch(value) else value


def with_ids(transitions: list[Any]) -> list[Any]:
    """Transitions in which those without an id have the lowest free numbers."""
    taken = {str(item.get("id")) for item in transitions if isinstance(item, dict)}
    free = (number for number in itertools.count() if str(number) not in taken)
    return [{"id": next(free), **item} if isinstance(item, dict) and "id" not in item else item for item in transitions]
