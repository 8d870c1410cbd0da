"""Checks of how the parts of a machine fit together. They run before driving and find all problems at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import cast

from tral_env.errors import MachineError, nearest, problem_report
from tral_fsm.definition import packaged
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.machine import STATES, Load, MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.definition.validated import Id


@dataclass(frozen=True)
class Problem:
    """One fault of a machine file."""

    pointer: str
    """JSON pointer to the place of the fault; empty: the whole file."""
    message: str
    """What was got and what is allowed."""
    place: str = ""
    """The place in words, in a file that is no plain JSON: an element of a diagram, a line."""

    def __str__(self) -> str:
        return f"{self.place or self.pointer or '/'}: {self.message}"


class FormatError(MachineError):
    """A machine file cannot be used. `problems` lists all that is wrong with it."""

    def __init__(self, source: str, problems: Iterable[Problem]) -> None:
        self.source = source
        self.problems = tuple(problems)
        super().__init__(problem_report(source, self.problems))

    def __reduce__(self) -> tuple[type[FormatError], tuple[str, tuple[Problem, ...]]]:
        """Let the error travel whole between processes."""
        return FormatError, (self.source, self.problems)


def check(machine: MachineDefinition, load: Load | None = None, around: tuple[str, ...] = ()) -> list[Problem]:
    """All faults in how the parts of a machine fit together, also in the machines inside it.

    Args:
        machine: the definition.
        load: for the packaged machines that the machine names; None: they are taken for right.
        around: names of the machines around this one, the outermost first.

    Returns:
        The problems, with JSON pointers into the definition; empty if it can be driven.
    """
    states: list[StateSpec] = []
    inside: list[Problem] = []
    for index, state in enumerate(machine.states):
        held, found = _inner_problems(state.inner, load, around)
        states.append(state if held is None else state.model_copy(update={"machine": held}))
        inside += [replace(p, pointer=f"/states/{index}/machine{p.pointer}") for p in found]
    return [*check_level(machine.root, states, machine.transitions), *inside]


def _inner_problems(
    inner: MachineDefinition | str | None, load: Load | None, around: tuple[str, ...]
) -> tuple[MachineDefinition | None, list[Problem]]:
    """The machine behind the name that a state gives, None without one, and the problems of the machine it holds.

    Whether a named machine ends, or its root takes a target, is known only when it has been loaded.
    """
    if isinstance(inner, MachineDefinition):
        return None, check(inner, load, around)
    if inner is None or load is None:
        return None, []
    if inner not in packaged.names():
        return None, [Problem("", unknown_machine(inner, packaged.names()))]
    if inner in around:
        return None, [Problem("", f"holds itself: {' > '.join((*around, inner))}")]
    held = load(inner)
    return held, [Problem("", f"in {inner!r}, {problem}") for problem in check(held, load, (*around, inner))]


def check_level(
    root: Id | None, states: Sequence[StateSpec | None], transitions: Sequence[TransitionSpec | None]
) -> Iterator[Problem]:
    """Check one machine without the machines inside it. Parts that could not be read are None.

    Args:
        root: id of the root, or None.
        states: a state is a `StateSpec` with an empty type if only its id could be read.
        transitions: a transition has a `ConditionSpec` with an empty type if only its ends could be read.
    """
    level = _Level(root, states, transitions)
    broken = False
    for problem in chain(_ids(level), _ends(level)):
        broken = True
        yield problem
    yield from _conditions(level)
    yield from _shadowed(level)
    if level.complete and not broken:
        yield from _reachable(level)
        yield from _exits(level)
        yield from _cycles(level)


class _Level:
    """The parts of one machine, as far as they are known."""

    def __init__(
        self, root: Id | None, states: Sequence[StateSpec | None], transitions: Sequence[TransitionSpec | None]
    ) -> None:
        self.root = root
        self.states = [(index, state) for index, state in enumerate(states) if state is not None]
        self.transitions = [
            (index, transition) for index, transition in enumerate(transitions) if transition is not None
        ]
        self.by_id: dict[Id, StateSpec] = {}
        for _, state in self.states:
            self.by_id.setdefault(state.id, state)
        self.all_states = None not in states
        known = all(state.type for _, state in self.states) and all(
            transition.when.type for _, transition in self.transitions
        )
        self.complete = root is not None and self.all_states and None not in transitions and known


def _ids(level: _Level) -> Iterator[Problem]:
    """Each id stands once. 1 and "1" are the same id, since diagrams cannot tell them apart."""
    if not level.states and level.all_states:
        yield Problem("/states", "got no state: a machine needs at least one")
    lists: dict[str, Sequence[tuple[int, StateSpec | TransitionSpec]]]
    lists = {"states": level.states, "transitions": level.transitions}
    for name, parts in lists.items():
        first: dict[str, int] = {}
        for index, part in parts:
            before = first.setdefault(str(part.id), index)
            if before != index:
                yield Problem(f"/{name}/{index}/id", f"got id {part.id!r}, which /{name}/{before} has already")


def _ends(level: _Level) -> Iterator[Problem]:
    """The root and both ends of each transition are states."""
    if not level.all_states or not level.states:
        return  # an end may be a state whose id could not be read
    if level.root is not None and level.root not in level.by_id:
        yield Problem("/root", f"got {level.root!r}, which is no state: {nearest(level.root, level.by_id)}")
    for index, transition in level.transitions:
        for name, end in (("from", transition.source), ("to", transition.target)):
            if end not in level.by_id:
                yield Problem(
                    f"/transitions/{index}/{name}", f"got {end!r}, which is no state: {nearest(end, level.by_id)}"
                )


def _reachable(level: _Level) -> Iterator[Problem]:
    """The root leads to every state."""
    targets: dict[Id, list[Id]] = {}
    for _, transition in level.transitions:
        if not transition.when.holds_never:
            targets.setdefault(transition.source, []).append(transition.target)
    seen, front = {level.root}, [level.root]
    while front:
        for target in targets.get(cast(Id, front.pop()), ()):
            if target not in seen:
                seen.add(target)
                front.append(target)
    for index, state in level.states:
        if state.id not in seen:
            yield Problem(f"/states/{index}", f"state {state.id!r} ({state.type}) cannot be reached from the root")


def _exits(level: _Level) -> Iterator[Problem]:
    """Every state can be left for another one, except those that may end the machine."""
    left = {
        transition.source
        for _, transition in level.transitions
        if transition.target != transition.source and not transition.when.holds_never
    }
    for index, state in level.states:
        if state.id not in left and not state.may_end:
            yield Problem(
                f"/states/{index}",
                f"state {state.id!r} ({state.type}) can never be left: give it a transition to another state, or "
                '"final": true if the machine may end there',
            )


def _with_parts(
    condition: ConditionSpec, pointer: str, hands_over: bool = True
) -> Iterator[tuple[ConditionSpec, str, bool]]:
    """A condition and all conditions that it combines.

    Yields:
        A condition, its JSON pointer, and whether it hands a gate to the next state itself.
    """
    hands_over = hands_over and condition.hands_over
    yield condition, pointer, hands_over and not condition.parts
    for index, part in enumerate(condition.parts):
        yield from _with_parts(part, f"{pointer}/of/{index}", hands_over)


def _conditions(level: _Level) -> Iterator[Problem]:
    """States can do what conditions ask: say that they are finished, have a target, take a gate."""
    for index, transition in level.transitions:
        owner, target = level.by_id.get(transition.source), level.by_id.get(transition.target)
        for condition, pointer, hands_over in _with_parts(transition.when, f"/transitions/{index}"):
            if owner is not None and owner.type:
                yield from _owner_problems(condition, owner, f"{pointer}/type")
            if hands_over and target is not None and target.type and not target.takes_target:
                yield Problem(
                    f"{pointer}/type",
                    f"hands the gate to state {target.id!r} ({target.type}), which takes no target. "
                    f'{_targetable()}; or "hand_over": false',
                )


def _owner_problems(condition: ConditionSpec, owner: StateSpec, pointer: str) -> Iterator[Problem]:
    """The state that a transition leaves can answer what the condition asks it."""
    leaving = f"leaves state {owner.id!r} ({owner.type}), which"
    if condition.asks_owner_finished and not owner.finishable:
        hint = f": {owner.never_finishes_hint}" if owner.never_finishes_hint else ""
        yield Problem(pointer, f"{condition.type} {leaving} never says that it is finished{hint}")
    if condition.asks_owner_target and not owner.takes_target:
        yield Problem(pointer, f"{condition.type} {leaving} takes no target. {_targetable()}")


def _targetable() -> str:
    names = ", ".join(name for name, spec in STATES.items() if spec.targetable)
    holders = " or ".join(name for name, spec in STATES.items() if spec.holds_machine)
    return f"Allowed: {names}, an {holders} whose root is one of them"


def _shadowed(level: _Level) -> Iterator[Problem]:
    """Every transition can fire, and none stands behind one that always fires first."""
    always_before: dict[Id, Id] = {}
    same_before: dict[tuple[Id, str], Id] = {}
    for index, transition in level.transitions:
        if not transition.when.type:
            continue
        dead = f"transition {transition.id!r} can never fire"
        if transition.when.holds_never:
            yield Problem(f"/transitions/{index}", f"{dead}: its condition holds in no tick")
        # As text, since a value in a plugin's condition may have no hash.
        same = (transition.source, repr(transition.when))
        if transition.source in always_before:
            other = always_before[transition.source]
            yield Problem(f"/transitions/{index}", f"{dead}: {other!r}, checked before it, fires always")
        elif same in same_before:
            other = same_before[same]
            yield Problem(f"/transitions/{index}", f"{dead}: {other!r}, checked before it, has the same condition")
        same_before.setdefault(same, transition.id)
        if transition.when.holds_always:
            always_before.setdefault(transition.source, transition.id)


def _cycles(level: _Level) -> Iterator[Problem]:
    """The machine goes round in no cycle for ever, one state a tick.

    A state belongs to such a cycle if the first of its transitions always fires. A transition that is asked before may
    lead out.
    """
    first: dict[Id, tuple[int, TransitionSpec]] = {}
    for index, transition in level.transitions:
        first.setdefault(transition.source, (index, transition))
    at_once = {source: found for source, found in first.items() if found[1].when.holds_always}
    done: set[Id] = set()
    for start in at_once:
        path: list[Id] = []
        here = start
        while here in at_once and here not in done:
            done.add(here)
            path.append(here)
            here = at_once[here][1].target
        if here in path:
            round_trip = [*path[path.index(here) :], here]
            yield Problem(
                f"/transitions/{at_once[here][0]}",
                f"goes round in no time: {' > '.join(str(name) for name in round_trip)}, each left at once",
            )


def unknown_machine(name: object, names: Iterable[str]) -> str:
    """The message for a name that no packaged machine has. The path of a file is no such name."""
    return f"got {str(name)[:60]!r}, which is no packaged machine: {nearest(name, names)}"
