"""A machine as SCXML."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

from tral_fsm.definition.machine import MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.formats.members import word
from tral_fsm.formats.scxml.reader import OURS, W3C
from tral_fsm.formats.tral_json import members
from tral_fsm.formats.xml_tree import is_legal, json_text

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*", re.ASCII)
"""Ids that are also XML ids."""


def dumps(machine: MachineDefinition) -> str:
    """Write a machine.

    Args:
        machine: the definition.

    Returns:
        XML text. An id that is no XML id (numbers, blanks) stands in `tral:id`, and `s0`, `s1`, ... replace it.
    """
    body = "\n".join(f"  {line}" for line in _machine(machine, ""))
    initial = _names(machine, "")[machine.root]
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<scxml xmlns="{W3C}" xmlns:tral="{OURS}" version="1.0" '
        f'datamodel="null" initial="{initial}">\n{body}\n</scxml>\n'
    )


def _names(machine: MachineDefinition, prefix: str) -> dict[int | str, str]:
    """Id -> XML id, unique in the file: in an inner machine it begins with that of the outer state."""
    taken = {state.id for state in machine.states if isinstance(state.id, str) and _NAME.fullmatch(state.id)}
    names: dict[int | str, str] = {}
    for index, state in enumerate(machine.states):
        name = state.id if state.id in taken else f"s{index}"
        while state.id not in taken and name in taken:
            name = f"{name}_"
        names[state.id] = f"{prefix}{name}"
    return names


def _machine(machine: MachineDefinition, prefix: str) -> Iterator[str]:
    """Lines of a machine."""
    names = _names(machine, prefix)
    head = {name: getattr(machine, name) for name in ("name", "description") if getattr(machine, name)}
    if head:
        yield f"<tral:machine{_ours(head)}/>"
    owned = [t for state in machine.states for t in machine.transitions if t.source == state.id]
    order = {t.id: index for index, t in enumerate(machine.transitions)} if owned != [*machine.transitions] else {}
    for state in machine.states:
        leaving = [t for t in machine.transitions if t.source == state.id]
        yield from _state(state, leaving, names, order)


def _state(
    state: StateSpec, leaving: list[TransitionSpec], names: dict[int | str, str], order: dict[int | str, int]
) -> Iterator[str]:
    name = names[state.id]
    values = {"type": state.type, **members(state)}
    own_id = {} if values.pop("id") == name else {"id": state.id}
    inner = state.inner if isinstance(state.inner, MachineDefinition) else None
    tag = "final" if state.final and not leaving and inner is None else "state"
    if tag == "final":
        values.pop("final")
    initial = ""
    lines: list[str] = []
    if inner is not None:
        values.pop("machine")
        initial = f' initial="{_names(inner, f"{name}.")[inner.root]}"'
        lines += _machine(inner, f"{name}.")
    for transition in leaving:
        lines += _transition(transition, names, order)
    start = f'<{tag} id="{name}"{initial}{_ours({**own_id, **values})}'
    yield from _element(start, tag, lines)


def _transition(transition: TransitionSpec, names: dict[int | str, str], order: dict[int | str, int]) -> Iterator[str]:
    event = "" if transition.when.type == "Always" else f' event="{transition.when.type}"'
    place = {"order": order[transition.id]} if order else {}
    when = {"type": transition.when.type, **members(transition.when)}
    start = f'<transition{event} target="{names[transition.target]}"'
    yield from _condition(start, "transition", {"id": transition.id, **place, **when})


def _condition(start: str, tag: str, values: Mapping[str, Any]) -> Iterator[str]:
    """An element; the parts of a combined condition are elements within it."""
    parts = values.get("of", ())
    own = {key: value for key, value in values.items() if key != "of"}
    lines = [line for part in parts for line in _condition("<tral:condition", "tral:condition", part)]
    yield from _element(f"{start}{_ours(own)}", tag, lines)


def _element(start: str, tag: str, lines: list[str]) -> Iterator[str]:
    if not lines:
        yield f"{start}/>"
        return
    yield f"{start}>"
    yield from (f"  {line}" for line in lines)
    yield f"</{tag}>"


def _ours(values: Mapping[str, Any]) -> str:
    """Attributes of the namespace of parameters."""
    return "".join(f" tral:{key}={quoteattr(_text(value))}" for key, value in values.items())


def _text(value: Any) -> str:
    """A value as JSON; a word stays as it is unless it could be read as JSON."""
    if isinstance(value, str) and is_legal(value) and word(value) == value and isinstance(word(value), str):
        return value
    return json_text(json.dumps(value, ensure_ascii=False))
