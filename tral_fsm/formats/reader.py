"""From plain JSON values to a checked definition: the one place that validates the files of all formats."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from tral_env import validation_text
from tral_env.errors import nearest
from tral_fsm.conditions import CONDITIONS
from tral_fsm.definition import packaged
from tral_fsm.definition.checks import FormatError, Problem, check_level, unknown_machine
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.machine import MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.definition.plugins import load_plugins, where_own_types_come_from
from tral_fsm.definition.validated import Id, Spec, unit_of
from tral_fsm.formats.plain import MAX_PROBLEMS, EnoughProblemsError, Plain, Problems, condensed, located
from tral_fsm.states import STATES

M = TypeVar("M", bound=Spec)

_ENDS = ("id", "from", "to")
_MAX_DEPTH = 32
_MAX_PARTS = 500
"""Largest number of states, transitions, or parts of a condition. Source: choice; office has 40 states."""
_MAX_PARTS_OF_FILE = 2000
"""Largest number of states, transitions and parts of conditions in a file. Source: choice."""


def definition(plain: Plain, source: str, problems: Problems | None = None) -> MachineDefinition:
    """Validate the values of a file.

    Args:
        plain: the values and their places.
        source: name of the file, for messages.
        problems: problems that the format has found; the rest is still checked.

    Returns:
        The definition.

    Raises:
        FormatError: the file has problems; the error lists all of them.
        MachineError: a plugin with states of its own cannot be loaded.
    """
    load_plugins()
    found = problems or Problems()
    machine = None
    with contextlib.suppress(EnoughProblemsError):
        machine = Reader(found).machine(plain.value, "", 0)
    if found.found or machine is None:
        raise FormatError(source, told(found, plain.places))
    return machine


def told(problems: Problems, places: Mapping[str, str]) -> list[Problem]:
    """Problems with their places, each once, and at most `MAX_PROBLEMS`; of a plain chart one for each part."""
    listed = condensed(problems) if problems.plain_chart else problems.found
    found = list(dict.fromkeys(located(problem, places) for problem in listed))
    if len(found) < MAX_PROBLEMS:
        return found
    return [*found[:MAX_PROBLEMS], Problem("", f"there may be more than these {MAX_PROBLEMS} problems")]


class Reader:
    """Turns plain JSON values into a definition, and collects their problems."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems
        self.complain = problems.complain
        self.parts = 0
        """Number of items of arrays so far."""

    def machine(self, raw: Any, pointer: str, depth: int) -> MachineDefinition | None:
        """A whole machine."""
        if self.problems.found and raw is None:
            return None
        if not self._object(raw, pointer, depth):
            return None
        before = len(self.problems.found)
        schema = ("$schema",) if depth == 0 else ()
        self._keys(raw, MachineDefinition, pointer, required=("root", "states"), also=schema)
        listed = self._array(raw, "states", pointer)
        states = [self.state(item, at, depth) for at, item in listed]
        transitions = [self.transition(item, at, depth) for at, item in self._array(raw, "transitions", pointer)]
        head = {key: raw[key] for key in ("root", "name", "description") if key in raw}
        if len(self.problems.found) > before:
            self._build(MachineDefinition, {**head, "states": ()}, pointer)
        known = [state or _with_id(item) for state, (_, item) in zip(states, listed, strict=True)]
        if isinstance(raw.get("states"), list):
            for problem in check_level(_id(raw.get("root")), known, transitions):
                self.complain(pointer + problem.pointer, problem.message)
        if len(self.problems.found) > before or None in (*states, *transitions):
            return None
        return self._build(
            MachineDefinition, {**head, "states": tuple(states), "transitions": tuple(transitions)}, pointer
        )

    def state(self, raw: Any, pointer: str, depth: int) -> StateSpec | None:
        """One state."""
        before = len(self.problems.found)
        spec = self._spec(raw, STATES, "state", pointer, depth)
        if spec is None:
            return None
        members = self._without_former(raw, spec, pointer)
        if spec.holds_machine:
            inner = members.get("machine")
            if isinstance(inner, Mapping):
                members["machine"] = self.machine(inner, f"{pointer}/machine", depth + 1)
                members["machine"] = members["machine"] or ""  # its problems are reported already
            elif isinstance(inner, str) and inner not in packaged.names():
                self.complain(f"{pointer}/machine", unknown_machine(inner, packaged.names()))
        built = self._build(spec, members, pointer)
        return built if len(self.problems.found) == before else None

    def transition(self, raw: Any, pointer: str, depth: int) -> TransitionSpec | None:
        """One transition, its condition flat beside its ends."""
        if not self._object(raw, pointer, depth):
            return None
        ends = {key: raw[key] for key in _ENDS if key in raw}
        inner = {key: value for key, value in raw.items() if key not in _ENDS}
        when = self.condition(inner, pointer, depth, also=_ENDS)
        return self._build(TransitionSpec, {**ends, "when": when or ConditionSpec(type="")}, pointer)

    def condition(self, raw: Any, pointer: str, depth: int, also: tuple[str, ...] = ()) -> ConditionSpec | None:
        """One condition, with those that it combines."""
        before = len(self.problems.found)
        spec = self._spec(raw, CONDITIONS, "transition", pointer, depth, also)
        if spec is None:
            return None
        members = self._without_former(raw, spec, pointer)
        if "of" in spec.model_fields and isinstance(raw.get("of"), list):
            found = [self.condition(part, at, depth + 1) for at, part in self._array(raw, "of", pointer)]
            members["of"] = tuple(part or ConditionSpec(type="") for part in found)
        built = self._build(spec, {key: value for key, value in members.items() if key not in also}, pointer)
        return built if len(self.problems.found) == before else None

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
        self.parts += len(items)
        if len(items) > _MAX_PARTS or self.parts > _MAX_PARTS_OF_FILE:
            allowed = f"at most {_MAX_PARTS} are allowed, {_MAX_PARTS_OF_FILE} in the whole file"
            self.complain(f"{pointer}/{key}", f"got {len(items)} of them: {allowed}")
            return []
        return [(f"{pointer}/{key}/{index}", item) for index, item in enumerate(items)]

    def _spec(
        self, raw: Any, known: Mapping[str, type[M]], what: str, pointer: str, depth: int, also: tuple[str, ...] = ()
    ) -> type[M] | None:
        """The class that a "type" names; unknown keys are problems."""
        if not self._object(raw, pointer, depth):
            return None
        name = raw.get("type")
        if not isinstance(name, str) or name not in known:
            got = f"got no type of {what}" if "type" not in raw else f"got {_show(name)}, which is no type of {what}"
            self.complain(
                f"{pointer}/type",
                f"{got}: {nearest(name, known)}" + (f". {where_own_types_come_from()}" if name else ""),
            )
            return None
        self._keys(raw, known[name], pointer, also=also)
        return known[name]

    def _keys(
        self,
        raw: dict[str, Any],
        spec: type[Spec],
        pointer: str,
        required: Iterable[str] = (),
        also: tuple[str, ...] = (),
    ) -> None:
        """Report keys that the class does not know, and required keys that are missing."""
        allowed = [*also, *(field.alias or name for name, field in spec.model_fields.items())]
        for key in raw:
            if key not in allowed and key not in spec.former:
                self.complain(f"{pointer}/{_escape(key)}", f"unknown key {_cut(repr(key))}: {nearest(key, allowed)}")
        for key in required:
            if key not in raw:
                self.complain(pointer, f"the key {key!r} is missing")

    def _without_former(self, raw: dict[str, Any], spec: type[Spec], pointer: str) -> dict[str, Any]:
        """The members of a part that still mean something; of the others there is a note."""
        former = [key for key in raw if key in spec.former]
        self.problems.notes += [
            f"{pointer}/{key} is of an earlier version and does nothing: delete it" for key in former
        ]
        return {key: value for key, value in raw.items() if key not in former}

    def _build(self, spec: type[M], members: dict[str, Any], pointer: str) -> M | None:
        """An object of a class, or None and its problems; unknown keys were reported before."""
        names = {name for key, field in spec.model_fields.items() for name in (key, field.alias)}
        known = {key: value for key, value in members.items() if key in names}
        whole = len(known) == len(members)
        try:
            return spec.model_validate(known)
        except ValidationError as error:
            faults = error.errors(include_url=False)
        together = list(spec.cross_field_errors(known))
        for fault in faults:
            misspelt = fault["type"] == "missing" and not whole
            if not misspelt and _of_validator(fault) not in together:
                self._fault(fault, spec, pointer)
        for text in together if whole else ():
            self.complain(pointer, text)
        return None

    def _fault(self, fault: Mapping[str, Any], spec: type[Spec], pointer: str) -> None:
        steps, annotation, _ = validation_text.place(spec, fault)
        at = pointer + "".join(f"/{_escape(str(step))}" for step in steps)
        got = fault["input"]
        if fault["type"] == "missing":
            self.complain(pointer, f"the key {steps[-1]!r} is missing")
        elif fault["type"] == "literal_error":
            self.complain(at, f"got {_show(got)}: {nearest(got, validation_text.choices(annotation))}")
        elif fault["type"] == "value_error":
            self.complain(at, _of_validator(fault))
        elif not any(p.pointer == at for p in self.problems.found):
            allowed = _allowed(annotation, fault) + _unit(spec, steps)
            self.complain(at, f"got {_show(got)}: expected {allowed}{_hint(got)}")


def _allowed(annotation: Any, fault: Mapping[str, Any]) -> str:
    if MachineDefinition in validation_text.members(annotation):
        return "a machine or a name"
    return validation_text.allowed(annotation, fault)


def _unit(spec: type[Spec], steps: tuple[int | str, ...]) -> str:
    """Unit of a parameter, as the end of what is expected; empty: it has none."""
    unit = unit_of(spec, str(steps[0])) if len(steps) == 1 and steps[0] in spec.model_fields else ""
    return f", in {unit}" if unit else ""


def _id(value: Any) -> Id | None:
    """An id, if a value may be one."""
    try:
        return _ID.validate_python(value)
    except ValidationError:
        return None


def _with_id(raw: Any) -> StateSpec | None:
    """A state with only its id, for one that cannot be read; None without a readable id."""
    got = _id(raw.get("id")) if isinstance(raw, dict) else None
    return None if got is None else StateSpec.model_validate({"type": "", "id": got})


_ID: TypeAdapter[Id] = TypeAdapter(Id)


def _of_validator(fault: Mapping[str, Any]) -> str:
    """Message of a validator of a class; empty for other faults."""
    return str(fault["ctx"]["error"]) if fault["type"] == "value_error" else ""


def _hint(got: Any) -> str:
    """Hint for a number in quotes, as in files of 2016, or with a decimal comma."""
    text = got if isinstance(got, str) else ""
    if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", text):
        return f". A decimal comma? Write {text.strip().replace(',', '.')}"
    try:
        float(text)
    except ValueError:
        return ""
    return '. Numbers stand without quotes, but in files that say "units": "2016"'


def _escape(key: str) -> str:
    return key.replace("~", "~0").replace("/", "~1")


def _show(value: Any) -> str:
    if isinstance(value, tuple) and any(isinstance(item, Spec) for item in value):
        return f"{len(value)} of them"
    return _cut(json.dumps(value, default=str))


def _cut(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."
