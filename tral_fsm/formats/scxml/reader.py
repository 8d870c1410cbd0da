"""Reader of SCXML, the state charts of the W3C, with parameters in the namespace of TRAL.

An attribute of this namespace holds JSON, or else a word. The parts of a combined condition are such an attribute of
their transition, and an inline machine consists of states within its state. Many programs drop namespaces, so a name
that SCXML has too ends with an underscore: `tral:id_` beside `id`. Files in which it does not, and in which conditions
are elements, can still be read.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from tral_env.checks import is_number
from tral_fsm.formats.members import word
from tral_fsm.formats.plain import MIN_PLAIN_STATES, Plain, Problems
from tral_fsm.formats.units2016 import with_ids
from tral_fsm.formats.xml_tree import Node

W3C = "http://www.w3.org/2005/07/scxml"
OURS = "urn:tral:machine"
"""Namespace of the parameters."""

_STATE, _FINAL, _TRANSITION, _INITIAL = (f"{{{W3C}}}{tag}" for tag in ("state", "final", "transition", "initial"))
_MACHINE, _CONDITION = f"{{{OURS}}}machine", f"{{{OURS}}}condition"
"""Elements of older files: name and description of a machine, and a part of a condition."""
HEAD = "machine-"
"""Attributes of the element around a machine begin with it: `machine-name`, `machine-description`."""
TAKEN = ("id", "initial", "event", "cond", "target", "type", "name")
"""Names of attributes of SCXML. Ours with the same name end with an underscore."""
_ATTRIBUTES = {
    f"{{{W3C}}}scxml": ("initial", "name", "version", "datamodel", "binding"),
    _STATE: ("id", "initial"),
    _FINAL: ("id",),
    _TRANSITION: ("event", "cond", "target", "type"),
    _INITIAL: (),
    _MACHINE: (),
    _CONDITION: (),
}
"""Tag -> its attributes of SCXML that may stand in a machine."""


def plain(root: Node, problems: Problems) -> Plain:
    """The machine of an SCXML file.

    Args:
        root: the file.
        problems: takes the problems of the file.
    """
    atoms = [
        node for node in _all(root) if node.tag == _STATE and not any(c.tag in (_STATE, _FINAL) for c in node.children)
    ]
    if len(atoms) >= MIN_PLAIN_STATES and all(_ours(node, "type") is None for node in atoms):
        problems.plain_chart = (
            "a plain chart: no state has a tral:type. `tral fsm states` lists the types, and `tral fsm new my.scxml` "
            "writes a machine to begin with"
        )
    reading = _Reading(problems)
    return Plain(reading.machine(root, ""), reading.places)


class _Reading:
    """Turns elements into states and transitions."""

    def __init__(self, problems: Problems) -> None:
        self.problems = problems
        self.places: dict[str, str] = {}

    def complain(self, pointer: str, message: str, node: Node) -> None:
        self.problems.complain(pointer, message, _place(node))

    def machine(self, node: Node, pointer: str) -> dict[str, Any]:
        """A whole machine: the document, or a state that holds states."""
        self.places[pointer] = _place(node)
        nodes = [child for child in node.children if child.tag in (_STATE, _FINAL)]
        ids = {child.attributes.get("id", ""): _id(child) for child in nodes}
        states = [self.state(child, f"{pointer}/states/{index}") for index, child in enumerate(nodes)]
        arrows = [(child, arrow) for child in nodes for arrow in child.children if arrow.tag == _TRANSITION]
        arrows.sort(key=lambda pair: self.order(pair[1]))
        transitions = [
            self.transition(arrow, owner, ids, f"{pointer}/transitions/{index}")
            for index, (owner, arrow) in enumerate(arrows)
        ]
        whole = node.tag not in (_STATE, _FINAL)
        self.strangers(node, pointer, (_STATE, _FINAL, _INITIAL, _MACHINE, *(() if whole else (_TRANSITION,))))
        value: dict[str, Any] = {"root": self.root(node, ids), "states": states, "transitions": with_ids(transitions)}
        return value | self.head(node, pointer, whole)

    def head(self, node: Node, pointer: str, whole: bool) -> dict[str, Any]:
        """Name and description of a machine."""
        ours = self.members(node)
        found = {key.removeprefix(HEAD): value for key, value in ours.items() if key.startswith(HEAD)}
        if whole:
            found |= {key: value for key, value in ours.items() if not key.startswith(HEAD)}
        for older in node.all(_MACHINE):
            self.strangers(older, pointer, ())
            found |= self.members(older)
        if whole and "name" in node.attributes:
            found.setdefault("name", node.attributes["name"])
        for key in found.keys() - {"name", "description"}:
            self.complain(pointer, f"got tral:{key} of a machine. Allowed: {HEAD}name, {HEAD}description", node)
        return {key: found[key] for key in ("name", "description") if key in found}

    def root(self, node: Node, ids: dict[str, Any]) -> Any:
        """Id of the state that "initial" names, else of the first state, as in the W3C's standard."""
        name = node.attributes.get("initial")
        within = [arrow.attributes.get("target") for initial in node.all(_INITIAL) for arrow in initial.children]
        if len(within) + (name is not None) > 1:
            self.complain("", f"got {len(within) + (name is not None)} initial states, expected one", node)
        name = next(iter(within), name)
        if name is None:
            return next(iter(ids.values()), None)
        return ids.get(name.strip(), name)

    def state(self, node: Node, pointer: str) -> dict[str, Any]:
        """A state; one that holds states holds a machine."""
        self.places[pointer] = _place(node)
        found: dict[str, Any] = {} if node.attributes.get("id") is None else {"id": _id(node)}
        if node.tag == _FINAL:
            found |= {"type": "Stop", "final": True}
        found |= {key: value for key, value in self.members(node).items() if not key.startswith(HEAD)}
        if _holds_states(node):
            found = {"type": "FSMState", **found, "machine": self.machine(node, f"{pointer}/machine")}
        else:
            self.strangers(node, pointer, (_TRANSITION,))
        return found

    def transition(self, node: Node, owner: Node, ids: dict[str, Any], pointer: str) -> dict[str, Any]:
        """A transition; its source is the state around it."""
        self.places[pointer] = _place(node)
        if "cond" in node.attributes:
            self.complain(pointer, "got cond, which is not read: tral:type and its parameters say when it fires", node)
        event = node.attributes.get("event")
        found = {"type": event or "Always", **self.condition(node, pointer, ("order",))}
        if event is not None and event != found["type"]:
            self.complain(
                f"{pointer}/type", f"got the event {event[:60]!r}, but tral:type says {found['type']!r}", node
            )
        targets = node.attributes.get("target", "").split()
        if len(targets) == 1:
            found["to"] = ids.get(targets[0], targets[0])
        elif targets:
            self.complain(f"{pointer}/to", f"got {len(targets)} targets, expected one", node)
            found["to"] = None
        return {**found, "from": _id(owner)}

    def condition(self, node: Node, pointer: str, without: tuple[str, ...] = ()) -> dict[str, Any]:
        """A condition with its parts."""
        found = {key: value for key, value in self.members(node).items() if key not in without}
        parts = list(node.all(_CONDITION))
        if parts and "of" in found:
            self.complain(pointer, "got tral:of beside <tral:condition>, expected one of them", node)
        if parts:
            found["of"] = [self.condition(part, f"{pointer}/of/{index}") for index, part in enumerate(parts)]
        self.strangers(node, pointer, (_CONDITION,))
        return found

    def members(self, node: Node) -> dict[str, Any]:
        """Attributes of the namespace of parameters; other attributes that a machine cannot have are problems."""
        start = f"{{{OURS}}}"
        found: dict[str, Any] = {}
        for name, text in node.attributes.items():
            own = name.removeprefix(start)
            key = own.removesuffix("_") if own.removesuffix("_") in TAKEN else own
            if own != name and key in found:
                self.complain("", f"got tral:{key} and tral:{key}_, expected one of them", node)
            elif own != name:
                found[key] = word(text)
            elif "}" not in name and name not in _ATTRIBUTES.get(node.tag, (name,)):
                self.complain(
                    "", f"got the attribute {name[:60]!r}: parameters are in a namespace, tral:{name[:60]}", node
                )
        return found

    def order(self, node: Node) -> float:
        """Place of a transition among those of its machine; infinite without one."""
        value = word(node.attributes.get(f"{{{OURS}}}order", "null"))
        if value is None:
            return math.inf
        if not is_number(value):
            self.complain("", f"got order {value!r}, expected a number", node)
            return math.inf
        return value

    def strangers(self, node: Node, pointer: str, known: tuple[str, ...]) -> None:
        """Report elements of SCXML, and text, that a machine cannot have."""
        if node.text.strip():
            self.complain(pointer, f"got the text {node.text.strip()[:60]!r} in it", node)
        for child in node.children:
            if child.tag not in known:
                allowed = ", ".join(tag.rpartition("}")[2] for tag in known)
                self.complain(pointer, f"got <{child.tag.rpartition('}')[2]}> in it. Allowed: {allowed}", child)


def _holds_states(node: Node) -> bool:
    return any(child.tag in (_STATE, _FINAL) for child in node.children)


def _all(node: Node) -> Iterator[Node]:
    """An element and all elements in it."""
    yield node
    for child in node.children:
        yield from _all(child)


def _place(node: Node) -> str:
    name = node.attributes.get("id") or _ours(node, "id")
    tag = node.tag.rpartition("}")[2]
    return f"{tag} '{name}' (line {node.line})" if name else f"{tag} (line {node.line})"


def _id(node: Node) -> Any:
    """Id of a state: that of the namespace, because an XML id is no number and has no blanks, else the XML id."""
    ours = _ours(node, "id")
    return node.attributes.get("id") if ours is None else word(ours)


def _ours(node: Node, name: str) -> str | None:
    """Text of an attribute of ours that SCXML has too."""
    return node.attributes.get(f"{{{OURS}}}{name}_", node.attributes.get(f"{{{OURS}}}{name}"))
