"""Mermaid and PlantUML: pictures of a machine for pages that draw them; they can only be written."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator

from tral_fsm.definition.machine import MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.definition.prose import combined, in_full

_PLANTUML = re.compile(r"([$\\])|(?<=_)_|(?<=-)-|(?<==)=|(?<=\[)\[|(?<=\])\]|[^\w .,()\[\]+=:-]")
"""Signs that mean something in PlantUML; the first group are those of which a code `&#36;` makes it fail."""


def mermaid(machine: MachineDefinition) -> str:
    """A machine as a Mermaid `stateDiagram-v2`."""
    lines = _lines(machine, "s", _mermaid_text)
    title = f"---\ntitle: {json.dumps(machine.name)}\n---\n" if machine.name else ""
    return title + "stateDiagram-v2\n" + "".join(f"  {line}\n" for line in lines)


def plantuml(machine: MachineDefinition) -> str:
    """A machine as a PlantUML state diagram."""
    lines = _lines(machine, "s", _plantuml_text, named_group=True)
    title = f"title {_plantuml_text(machine.name)}\n" if machine.name else ""
    return f"@startuml\n{title}hide empty description\n" + "".join(f"{line}\n" for line in lines) + "@enduml\n"


def _lines(
    machine: MachineDefinition, prefix: str, text: Callable[[str], str], named_group: bool = False
) -> Iterator[str]:
    """Lines that both languages share: states under new names, and arrows between them.

    A state that holds states is named in the line that opens it (PlantUML), or in a line before it (Mermaid).
    """
    names = {state.id: f"{prefix}{index}" for index, state in enumerate(machine.states)}
    for state in machine.states:
        yield from _state(state, names[state.id], text, named_group)
    yield f"[*] --> {names[machine.root]}"
    for transition in machine.transitions:
        yield f"{names[transition.source]} --> {names[transition.target]} : {text(_label(transition))}"
    left = {transition.source for transition in machine.transitions}
    yield from (f"{names[state.id]} --> [*]" for state in machine.states if state.may_end and state.id not in left)


def _state(state: StateSpec, name: str, text: Callable[[str], str], named_group: bool) -> Iterator[str]:
    named = f'state "{text(state.label or str(state.id))}" as {name}'
    if isinstance(state.inner, MachineDefinition):
        yield from [f"{named} {{"] if named_group else [named, f"state {name} {{"]
        yield from (f"  {line}" for line in _lines(state.inner, f"{name}_", text, named_group))
        yield "}"
    else:
        yield named
        yield f"{name} : {text(state.type)}"


def _label(transition: TransitionSpec) -> str:
    return f"{transition.id}: {combined(transition.when, in_full, inside=True)}"


def _mermaid_text(text: str) -> str:
    """Text in which signs that mean something in Mermaid are character codes."""
    return re.sub(r"[^\w .,()\[\]/+*=-]", lambda found: f"#{ord(found[0])};", _one_line(text)) or "#32;"


def _plantuml_text(text: str) -> str:
    """Text in which signs that mean something in PlantUML are character codes.

    The code `&#36;` of a dollar makes PlantUML fail, and so does that of a backslash. Signs that mark text in pairs
    (`__`, `--`, `[[`) are codes from the second on.
    """

    def coded(found: re.Match[str]) -> str:
        return f"<U+{ord(found[1]):04X}>" if found[1] else f"&#{ord(found[0])};"

    return _PLANTUML.sub(coded, _one_line(text)) or "&#32;"


def _one_line(text: str) -> str:
    return " ".join(text.split())
