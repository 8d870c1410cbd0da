"""What can be wrong with a machine although each of its parts is right. Found before driving, all at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from tral_env.errors import MachineError, nearest
from tral_fsm.definition import (
    STATES,
    AllSpec,
    AlwaysSpec,
    AnySpec,
    ArucoGateFoundSpec,
    ConditionSpec,
    FinishedSpec,
    FSMStateSpec,
    MachineDefinition,
    NotSpec,
    StateSpec,
    TransitionSpec,
    UnreachableSpec,
)


@dataclass(frozen=True)
class Problem:
    """One fault of a machine file."""

    pointer: str
    """JSON pointer to the place; empty: the whole file."""
    message: str
    """What was got and what is allowed."""
    place: str = ""
    """Where that is in a file that is no plain JSON, in words: an element of a diagram, a line."""

    def __str__(self) -> str:
        return f"{self.place or self.pointer or '/'}: {self.message}"


class FormatError(MachineError):
    """A machine file cannot be used. All that is wrong with it stands in `problems`."""

    def __init__(self, source: str, problems: Iterable[Problem]) -> None:
        self.source = source
        self.problems = tuple(problems)
        lines = "".join(f"\n  {problem}" for problem in self.problems)
        super().__init__(f"{source}: {len(self.problems)} problem{'s' * (len(self.problems) != 1)}{lines}")

    def __reduce__(self) -> tuple[type[FormatError], tuple[str, tuple[Problem, ...]]]:
        """Come whole out of a process of its own."""
        return FormatError, (self.source, self.problems)


def check(machine: MachineDefinition) -> list[Problem]:
    """All faults in how the parts of a machine hang together.

    Args:
        machine: the definition.

    Returns:
        The problems, with JSON pointers into the definition; empty if it can be driven.
    """
    states = {state.id: state for state in machine.states}
    problems = [*_ids(machine), *_ends(machine, states)]
    for index, state in enumerate(machine.states):
        if isinstance(state, FSMStateSpec) and isinstance(state.machine, MachineDefinition):
            inner = check(state.machine)
            problems += [Problem(f"/states/{index}/machine{p.pointer}", p.message) for p in inner]
    if not problems:
        problems += [*_reachable(machine), *_ways_out(machine), *_conditions(machine, states), *_shadowed(machine)]
    return problems


def _ids(machine: MachineDefinition) -> Iterator[Problem]:
    """Each id once. 1 and "1" are the same id, since diagrams cannot tell them apart."""
    if not machine.states:
        yield Problem("/states", "got no state: a machine needs at least one")
    lists = {"states": [s.id for s in machine.states], "transitions": [t.id for t in machine.transitions]}
    for name, ids in lists.items():
        first: dict[str, int] = {}
        for index, got in enumerate(ids):
            before = first.setdefault(str(got), index)
            if before != index:
                yield Problem(f"/{name}/{index}/id", f"got id {got!r}, which /{name}/{before} has already")


def _ends(machine: MachineDefinition, states: dict[int | str, StateSpec]) -> Iterator[Problem]:
    """Root and both ends of every transition are states."""
    if machine.root not in states and states:
        yield Problem("/root", f"got {machine.root!r}, which is no state: {nearest(machine.root, states)}")
    for index, transition in enumerate(machine.transitions):
        for name, end in (("from", transition.source), ("to", transition.target)):
            if end not in states:
                yield Problem(f"/transitions/{index}/{name}", f"got {end!r}, which is no state: {nearest(end, states)}")


def _reachable(machine: MachineDefinition) -> Iterator[Problem]:
    """Every state can be come to from the root."""
    seen, front = {machine.root}, [machine.root]
    while front:
        here = front.pop()
        for transition in machine.transitions:
            if transition.source == here and transition.target not in seen:
                seen.add(transition.target)
                front.append(transition.target)
    for index, state in enumerate(machine.states):
        if state.id not in seen:
            yield Problem(f"/states/{index}", f"state {state.id!r} ({state.type}) cannot be reached from the root")


def _ways_out(machine: MachineDefinition) -> Iterator[Problem]:
    """Every state can be left, but for those that may end the machine, and a machine of one state."""
    left = {transition.source for transition in machine.transitions}
    for index, state in enumerate(machine.states):
        if state.id not in left and not state.may_end:
            yield Problem(
                f"/states/{index}",
                f"state {state.id!r} ({state.type}) can never be left: give it a transition, or "
                '"final": true if the machine may end there',
            )


def parts(condition: ConditionSpec, pointer: str) -> Iterator[tuple[ConditionSpec, str]]:
    """A condition and all that it is combined of, each with its JSON pointer."""
    yield condition, pointer
    if isinstance(condition, AllSpec | AnySpec | NotSpec):
        for index, part in enumerate(condition.of):
            yield from parts(part, f"{pointer}/of/{index}")


def _conditions(machine: MachineDefinition, states: dict[int | str, StateSpec]) -> Iterator[Problem]:
    """Finished leaves finishable states, gates are handed to targetable ones."""
    for index, transition in enumerate(machine.transitions):
        owner, target = states[transition.source], states[transition.target]
        for condition, pointer in parts(transition.when, f"/transitions/{index}"):
            if isinstance(condition, FinishedSpec) and not owner.finishable:
                yield Problem(f"{pointer}/type", _not_finishable(owner))
            if isinstance(condition, UnreachableSpec) and not owner.targetable:
                yield Problem(
                    f"{pointer}/type", f"leaves state {owner.id!r} ({owner.type}), which has no target: {_targetable()}"
                )
            if isinstance(condition, ArucoGateFoundSpec) and condition.hand_over and not target.targetable:
                yield Problem(
                    f"{pointer}/type",
                    f"hands the gate to state {target.id!r} ({target.type}), which takes no target. "
                    f'{_targetable()}; or "hand_over": false',
                )


def _targetable() -> str:
    return f"Allowed: {', '.join(name for name, spec in STATES.items() if spec.targetable)}"


def _not_finishable(owner: StateSpec) -> str:
    hint = ": a Motor needs a distance for that" if owner.type == "Motor" else ""
    return f"Finished leaves state {owner.id!r} ({owner.type}), which never says that it is finished{hint}"


def _shadowed(machine: MachineDefinition) -> Iterator[Problem]:
    """No transition stands behind an Always of the same state."""
    always: dict[int | str, TransitionSpec] = {}
    for index, transition in enumerate(machine.transitions):
        if transition.source in always:
            yield Problem(
                f"/transitions/{index}",
                f"transition {transition.id!r} can never fire: {always[transition.source].id!r}, checked before it, "
                "is Always",
            )
        elif isinstance(transition.when, AlwaysSpec):
            always[transition.source] = transition
