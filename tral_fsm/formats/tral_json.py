"""TRAL JSON: `{"root": 0, "states": [{"id": 0, "type": ...}], "transitions": [{"id", "type", "from", "to", ...}]}`.

A transition's condition stands flat beside its id, from and to; combined conditions hold theirs in "of".
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from tral_env.errors import nearest
from tral_fsm.checks import FormatError, Problem, check
from tral_fsm.definition import (
    CONDITIONS,
    STATES,
    ConditionSpec,
    MachineDefinition,
    Spec,
    StateSpec,
    TransitionSpec,
)

M = TypeVar("M", bound=Spec)

_ENDS = ("id", "from", "to")
_MAX_DEPTH = 32


def loads(text: str, source: str = "machine") -> MachineDefinition:
    """Read and check a machine.

    Args:
        text: the JSON text.
        source: name of the file, for messages.

    Returns:
        The definition.

    Raises:
        FormatError: with all problems that were found.
    """
    reader = _Reader()
    machine = reader.machine(reader.parse(text), "", 0)
    problems = reader.problems or (check(machine) if machine is not None else [])
    if problems or machine is None:
        raise FormatError(source, problems)
    return machine


def dumps(machine: MachineDefinition) -> str:
    """Write a machine: parameters that have their default are left out."""
    return json.dumps(as_json(machine), indent=2, ensure_ascii=False) + "\n"


def as_json(machine: MachineDefinition) -> dict[str, Any]:
    """A machine as plain JSON values, as it stands in a file."""
    whole: dict[str, Any] = {name: getattr(machine, name) for name in ("name", "description") if getattr(machine, name)}
    whole["root"] = machine.root
    whole["states"] = [_state(state) for state in machine.states]
    whole["transitions"] = [
        {"id": t.id, "type": t.when.type, "from": t.source, "to": t.target, **_members(t.when)}
        for t in machine.transitions
    ]
    return whole


def _state(state: StateSpec) -> dict[str, Any]:
    members = _members(state)
    return {"id": members.pop("id"), "type": state.type, **members}


def _members(spec: Spec) -> dict[str, Any]:
    """The members of a part that differ from their defaults, without its type."""
    members = {}
    for name, field in type(spec).model_fields.items():
        value = getattr(spec, name)
        if name != "type" and (field.is_required() or value != field.default):
            members[name] = _plain(value)
    return members


def _plain(value: Any) -> Any:
    if isinstance(value, MachineDefinition):
        return as_json(value)
    if isinstance(value, ConditionSpec):
        return {"type": value.type, **_members(value)}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


class _Reader:
    """Turns plain JSON values into a definition and collects what is wrong with them."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []

    def complain(self, pointer: str, message: str) -> None:
        self.problems.append(Problem(pointer, message))

    def parse(self, text: str) -> Any:
        """JSON text, refusing what JSON readers differ about: a key twice, NaN, endless nesting."""

        def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
            found = dict(pairs)
            for key in {key for key, _ in pairs} if len(found) < len(pairs) else ():
                if sum(key == other for other, _ in pairs) > 1:
                    self.complain("", f"got the key {key!r} twice in one object")
            return found

        def constant(name: str) -> float:
            self.complain("", f"got {name}: numbers must be finite")
            return 0.0

        try:
            return json.loads(text, object_pairs_hook=members, parse_constant=constant)
        except json.JSONDecodeError as error:
            self.complain("", f"not JSON: {error.msg} at line {error.lineno}, column {error.colno}")
        except RecursionError:
            self.complain("", "nested too deeply")
        except ValueError as error:  # an integer of thousands of digits
            self.complain("", f"not readable: {error}")
        return None

    def machine(self, raw: Any, pointer: str, depth: int) -> MachineDefinition | None:
        """A whole machine."""
        if self.problems and raw is None:
            return None
        if not self._object(raw, pointer, depth):
            return None
        before = len(self.problems)
        self._keys(raw, MachineDefinition, pointer, required=("root", "states"))
        states = [self.state(item, at, depth) for at, item in self._array(raw, "states", pointer)]
        transitions = [self.transition(item, at, depth) for at, item in self._array(raw, "transitions", pointer)]
        head = {key: raw[key] for key in ("root", "name", "description") if key in raw}
        if len(self.problems) > before:
            self._build(MachineDefinition, {**head, "states": ()}, pointer)
            return None
        return self._build(
            MachineDefinition, {**head, "states": tuple(states), "transitions": tuple(transitions)}, pointer
        )

    def state(self, raw: Any, pointer: str, depth: int) -> StateSpec | None:
        """One state."""
        spec = self._spec(raw, STATES, "state", pointer, depth)
        if spec is None:
            return None
        members = dict(raw)
        if isinstance(members.get("machine"), Mapping):
            members["machine"] = self.machine(members["machine"], f"{pointer}/machine", depth + 1)
            if members["machine"] is None:
                return None
        return self._build(spec, members, pointer)

    def transition(self, raw: Any, pointer: str, depth: int) -> TransitionSpec | None:
        """One transition, its condition flat beside its ends."""
        if not self._object(raw, pointer, depth):
            return None
        ends = {key: raw[key] for key in _ENDS if key in raw}
        inner = {key: value for key, value in raw.items() if key not in _ENDS}
        when = self.condition(inner, pointer, depth, also=_ENDS)
        return self._build(TransitionSpec, {**ends, "when": when or ConditionSpec(type="?")}, pointer)

    def condition(self, raw: Any, pointer: str, depth: int, also: tuple[str, ...] = ()) -> ConditionSpec | None:
        """One condition, with those that it combines."""
        spec = self._spec(raw, CONDITIONS, "transition", pointer, depth, also)
        if spec is None:
            return None
        members = dict(raw)
        if "of" in spec.model_fields and isinstance(raw.get("of"), list):
            found = [self.condition(part, at, depth + 1) for at, part in self._array(raw, "of", pointer)]
            if None in found:
                return None
            members["of"] = tuple(found)
        return self._build(spec, members, pointer)

    def _object(self, raw: Any, pointer: str, depth: int) -> bool:
        if depth > _MAX_DEPTH:
            self.complain(pointer, f"nested more than {_MAX_DEPTH} deep")
        elif not isinstance(raw, dict):
            self.complain(pointer, f"got {_show(raw)}, expected an object")
        return isinstance(raw, dict) and depth <= _MAX_DEPTH

    def _array(self, raw: dict[str, Any], key: str, pointer: str) -> list[tuple[str, Any]]:
        items = raw.get(key, [])
        if not isinstance(items, list):
            self.complain(f"{pointer}/{key}", f"got {_show(items)}, expected an array")
            return []
        return [(f"{pointer}/{key}/{index}", item) for index, item in enumerate(items)]

    def _spec(
        self, raw: Any, known: Mapping[str, type[M]], what: str, pointer: str, depth: int, also: tuple[str, ...] = ()
    ) -> type[M] | None:
        """The class that a "type" names, once its keys are known to fit."""
        if not self._object(raw, pointer, depth):
            return None
        name = raw.get("type")
        if not isinstance(name, str) or name not in known:
            got = f"got no type of {what}" if "type" not in raw else f"got {_show(name)}, which is no type of {what}"
            self.complain(f"{pointer}/type", f"{got}: {nearest(name, known)}")
            return None
        fit = self._keys(raw, known[name], pointer, also=also)
        return known[name] if fit else None

    def _keys(
        self,
        raw: dict[str, Any],
        spec: type[Spec],
        pointer: str,
        required: Iterable[str] = (),
        also: tuple[str, ...] = (),
    ) -> bool:
        """Every key is one of the class, and none of the required is missing."""
        allowed = [*also, *(field.alias or name for name, field in spec.model_fields.items())]
        unknown = [key for key in raw if key not in allowed]
        for key in unknown:
            self.complain(f"{pointer}/{_escape(key)}", f"unknown key {key!r}: {nearest(key, allowed)}")
        missing = [key for key in required if key not in raw]
        for key in missing:
            self.complain(pointer, f"the key {key!r} is missing")
        return not unknown and not missing

    def _build(self, spec: type[M], members: dict[str, Any], pointer: str) -> M | None:
        """An object of a class, or None and the problems why not."""
        try:
            return spec.model_validate(members)
        except ValidationError as error:
            for fault in error.errors(include_url=False):
                self._fault(fault, spec, pointer)
            return None

    def _fault(self, fault: Mapping[str, Any], spec: type[Spec], pointer: str) -> None:
        place = [part for part in fault["loc"] if not (isinstance(part, str) and "[" in part) and part not in _UNIONS]
        at = pointer + "".join(f"/{_escape(str(part))}" for part in place)
        if fault["type"] == "missing":
            self.complain(pointer, f"the key {place[-1]!r} is missing")
        elif fault["type"] == "value_error":
            self.complain(at, str(fault["ctx"]["error"]))
        elif fault["type"] == "literal_error":
            allowed = fault["ctx"]["expected"].replace("'", "").replace(" or ", ", ").split(", ")
            self.complain(at, f"got {_show(fault['input'])}: {nearest(fault['input'], allowed)}")
        elif not any(p.pointer == at for p in self.problems):
            self.complain(at, f"got {_show(fault['input'])}: {fault['msg']}")


_UNIONS = ("int", "str", "MachineDefinition")
"""What pydantic adds to a place to say which member of a union it tried."""


def _escape(key: str) -> str:
    return key.replace("~", "~0").replace("/", "~1")


def _show(value: Any) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else text[:57] + "..."
