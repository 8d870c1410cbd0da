"""A machine and its inner machines, each once, and the colour that a state has in every picture."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from tral_env.errors import MachineError
from tral_fsm.definition.machine import MachineDefinition, StateSpec
from tral_fsm.definition.validated import Id
from tral_fsm.draw import text

TONES = (
    "#0b5cad", "#b3261e", "#1b7f3b", "#7a3db8", "#a85a00", "#00707a", "#a3195b", "#5a6472", "#5f6b00", "#c800b4",
    "#5a1e00", "#2d2d5a", "#690069", "#003c00", "#0069ff", "#a55a96", "#e11e78", "#a500ff", "#4b4b2d", "#0000ff",
    "#4b0096", "#3f3fbf", "#6900ff", "#0000b4",
)  # fmt: skip
"""Colours of states, one after the other; each is readable on white. Source: choice, far apart in OKLab."""

Resolve = Callable[[str], MachineDefinition]
Key = str | int | None
"""Name of a packaged machine, identity of one that stands in a state, None for the outermost one."""


@dataclass(frozen=True)
class Panel:
    """A machine with its heading, and the colour of each of its states."""

    key: Key
    heading: str
    machine: MachineDefinition
    tones: tuple[str, ...]


def panels(machine: MachineDefinition, resolve: Resolve | None = None) -> list[Panel]:
    """The machine and its inner ones, outer ones first; each comes once. The colours go on from panel to panel.

    Args:
        machine: a checked definition.
        resolve: function from a name to its packaged machine, such as `tral_fsm.load_machine`; None: no names.

    Raises:
        MachineError: the machine names another one, and `resolve` is None.
    """
    front: list[tuple[Key, str, MachineDefinition]] = [(None, machine.name or "machine", machine)]
    found: list[Panel] = []
    seen: set[Key] = set()
    used = 0
    while front:
        key, heading, here = front.pop(0)
        tones = tuple(TONES[(used + i) % len(TONES)] for i in range(len(here.states)))
        found.append(Panel(key, heading, here, tones))
        used += len(tones)
        for state in here.states:
            if state.inner is not None and _key(state) not in seen:
                seen.add(_key(state))
                front.append((_key(state), *_inner(state, resolve)))
    return found


def state_tones(machine: MachineDefinition, resolve: Resolve | None = None) -> dict[str, str]:
    """Colour of each state in the machine's picture, by its name in a drive: "follow", or "corner/turn left".

    Args:
        machine: a checked definition.
        resolve: as in `panels`.

    Returns:
        Name -> colour such as "#0b5cad". Of states with the same name the first one gives the colour.

    Raises:
        MachineError: the machine names another one, and `resolve` is None.
    """
    return {name: leaf.tone for name, leaf in _leaves(machine, resolve).items()}


def marks_of_states(machine: MachineDefinition, resolve: Resolve | None = None) -> dict[str, tuple[str, ...]]:
    """Names of the outlines in the machine's picture that stand for a state, by its name in a drive.

    Args:
        machine: a checked definition.
        resolve: as in `panels`.

    Returns:
        Name -> `Outline.name` of the outermost state and of those within it: "corner/turn left" -> ("1:corner",
        "2:turn left").
    """
    return {name: leaf.marks for name, leaf in _leaves(machine, resolve).items()}


def marks_of_transitions(
    machine: MachineDefinition, resolve: Resolve | None = None
) -> dict[tuple[tuple[Id, ...], Id], str]:
    """Names of the lines in the machine's picture: ids of the states around a transition, and its own id -> name."""
    numbers = _numbers(panels(machine, resolve))

    def walk(panel: Panel, path: tuple[Id, ...]) -> Iterator[tuple[tuple[tuple[Id, ...], Id], str]]:
        number = numbers[panel.key][0]
        for transition in panel.machine.transitions:
            yield (path, transition.id), mark_name(number, transition.id)
        for state in panel.machine.states:
            if state.inner is not None:
                yield from walk(numbers[_key(state)][1], (*path, state.id))

    return dict(walk(numbers[None][1], ()))


def mark_name(number: int, id: Id) -> str:
    """Name of what stands for a state or a transition in the panel of a number, 1 for the first."""
    return f"{number}:{id}"


@dataclass(frozen=True)
class _Leaf:
    """A state without a machine within it."""

    tone: str
    marks: tuple[str, ...]


def _leaves(machine: MachineDefinition, resolve: Resolve | None) -> dict[str, _Leaf]:
    """The states by their names in a drive; of states with the same name the first."""
    numbers = _numbers(panels(machine, resolve))

    def walk(panel: Panel, before: str, marks: tuple[str, ...]) -> Iterator[tuple[str, _Leaf]]:
        number = numbers[panel.key][0]
        for state, tone in zip(panel.machine.states, panel.tones, strict=True):
            name, here = before + (state.label or str(state.id)), (*marks, mark_name(number, state.id))
            if state.inner is None:
                yield name, _Leaf(tone, here)
            else:
                yield from walk(numbers[_key(state)][1], f"{name}/", here)

    named: dict[str, _Leaf] = {}
    for name, leaf in walk(numbers[None][1], "", ()):
        named.setdefault(name, leaf)
    return named


def _numbers(shown: list[Panel]) -> dict[Key, tuple[int, Panel]]:
    return {panel.key: (number, panel) for number, panel in enumerate(shown, 1)}


def _key(state: StateSpec) -> Key:
    return id(state.inner) if isinstance(state.inner, MachineDefinition) else state.inner


def _inner(state: StateSpec, resolve: Resolve | None) -> tuple[str, MachineDefinition]:
    """Heading and machine of a state that holds one."""
    inner = state.inner
    if isinstance(inner, MachineDefinition):
        return f"{inner.name or 'inline'}, in state {text.state_name(state)}", inner
    assert inner is not None, "only a state with a machine is asked"
    if resolve is None:
        raise MachineError(
            f"state {text.state_name(state)} names the machine {inner!r}, and nothing says which one that "
            "is: give picture(..., resolve=tral_fsm.load_machine)"
        )
    return inner, resolve(inner)
