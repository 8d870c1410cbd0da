"""A machine as SCXML."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

from tral_fsm.definition.machine import MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.formats.members import word
from tral_fsm.formats.scxml.reader import HEAD, OURS, TAKEN, W3C
from tral_fsm.formats.tral_json import condition_json, members
from tral_fsm.formats.xml_tree import is_legal, json_text

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*", re.ASCII)
"""Ids that are also XML ids."""


def dumps(machine: MachineDefinition) -> str:
    """Write a machine.

    Args:
        machine: the definition.

    Returns:
        XML text. An id that is no XML id (numbers, blanks) stands in `tral:id_`, and `s0`, `s1`, ... replace it.
        Programs that drop namespaces find no name twice in an element, and no element of ours.
    """
    body = "\n".join(f"  {line}" for line in _machine(machine, ""))
    initial = _names(machine, "")[machine.root]
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<scxml xmlns="{W3C}" xmlns:tral="{OURS}" version="1.0" '
        f'datamodel="null" initial="{initial}"{_head(machine)}>\n{body}\n</scxml>\n'
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
    owned = [t for state in machine.states for t in machine.transitions if t.source == state.id]
    order = {t.id: index for index, t in enumerate(machine.transitions)} if owned != [*machine.transitions] else {}
    for state in machine.states:
        leaving = [t for t in machine.transitions if t.source == state.id]
        yield from _state(state, leaving, names, order)


def _head(machine: MachineDefinition) -> str:
    """Attributes of the element around a machine."""
    said = {HEAD + name: getattr(machine, name) for name in ("name", "description") if getattr(machine, name)}
    return _ours(said)


def _state(
    state: StateSpec, leaving: list[TransitionSpec], names: dict[int | str, str], order: dict[int | str, int]
) -> Iterator[str]:
    name = names[state.id]
    values = members(state)
    own_id = {} if values.pop("id") == name else {"id": state.id}
    inner = state.inner if isinstance(state.inner, MachineDefinition) else None
    tag = "final" if state.final and not leaving and inner is None else "state"
    if tag == "final":
        values.pop("final")
    initial = ""
    lines: list[str] = []
    if inner is not None:
        values.pop("machine")
        initial = f' initial="{_names(inner, f"{name}.")[inner.root]}"{_head(inner)}'
        lines += _machine(inner, f"{name}.")
    for transition in leaving:
        lines += _transition(transition, names, order)
    kind = f" tral:type={quoteattr(_text(state.type))}"
    start = f'<{tag} id="{name}"{initial}{_ours(own_id)}{kind}{_ours(values)}'
    yield from _element(start, tag, lines)


def _transition(transition: TransitionSpec, names: dict[int | str, str], order: dict[int | str, int]) -> Iterator[str]:
    """An element without content, because content of a transition is executed. The event is the condition's type."""
    when = condition_json(transition.when)
    kind = when.pop("type")
    event = "" if kind == "Always" else f' event="{kind}"' if _NAME.fullmatch(kind) else _ours({"type": kind})
    place = {"order": order[transition.id]} if order else {}
    yield f'<transition{event} target="{names[transition.target]}"{_ours({"id": transition.id, **place, **when})}/>'


def _element(start: str, tag: str, lines: list[str]) -> Iterator[str]:
    if not lines:
        yield f"{start}/>"
        return
    yield f"{start}>"
    yield from (f"  {line}" for line in lines)
    yield f"</{tag}>"


def _ours(values: Mapping[str, Any]) -> str:
    """Attributes of the namespace of parameters."""
    named = ((f"{key}_" if key in TAKEN else key, value) for key, value in values.items())
    return "".join(f" tral:{key}={quoteattr(_text(value))}" for key, value in named)


def _text(value: Any) -> str:
    """A value as JSON; a word stays as it is unless it could be read as JSON."""
    if isinstance(value, str) and is_legal(value) and word(value) == value and isinstance(word(value), str):
        return value
    return json_text(json.dumps(value, ensure_ascii=False))
