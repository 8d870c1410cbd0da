"""Arbitrary machines that can run, built from the definition classes themselves: all types, all parameters."""

from typing import Any, Literal, get_args, get_origin

from hypothesis import strategies as st
from pydantic.fields import FieldInfo

from tral_fsm import check, machine_names
from tral_fsm.definition.conditions import CONDITIONS, ConditionSpec
from tral_fsm.definition.machine import STATES, MachineDefinition, StateSpec, TransitionSpec
from tral_fsm.definition.validated import Spec

COMBINED = ("All", "Any", "Not")
words = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
ids = (
    st.integers(-5, 10**20) | words.filter(bool) | st.sampled_from(["follow", "wall ahead", "--", "0x", "a=b", "größe"])
)


def number(field: FieldInfo, whole: bool) -> st.SearchStrategy[Any]:
    limits = {name: getattr(m, name) for m in field.metadata for name in ("ge", "gt", "le", "lt") if hasattr(m, name)}
    low, high = limits.get("ge", limits.get("gt")), limits.get("le", limits.get("lt"))
    if whole:
        return st.integers(low, high)
    return st.floats(
        low, high, exclude_min="gt" in limits, exclude_max="lt" in limits, allow_nan=False, allow_infinity=False
    )


def value(name: str, field: FieldInfo, depth: int) -> st.SearchStrategy[Any]:
    kind = field.annotation
    options = [option for option in get_args(kind) if option is not type(None)]
    if name == "machine":
        named = st.sampled_from(machine_names())
        return named | machines(depth + 1) if depth < 2 else named
    if name == "ids":
        return st.lists(st.integers(0, 49), max_size=3).map(tuple)
    if get_origin(kind) is Literal:
        return st.sampled_from(options)
    if kind is bool:
        return st.booleans()
    if kind is str:
        return words
    found = number(field, int in (kind, *options))
    return st.none() | found if type(None) in get_args(kind) else found


@st.composite
def parts(draw: st.DrawFn, spec: type[Spec], depth: int, **given: Any) -> Any:
    """An object of a class that follows its rules: some parameters by default, some not."""
    names = [name for name in spec.model_fields if name not in ("type", *given)]
    found = {
        name: draw(value(name, spec.model_fields[name], depth))
        for name in names
        if spec.model_fields[name].is_required() or draw(st.booleans())
    }
    if spec.exactly_one:
        one = draw(st.sampled_from(spec.exactly_one))
        for name in spec.exactly_one:
            found.pop(name, None)
        strategy = value(one, spec.model_fields[one], depth)
        found[one] = draw(strategy.filter(lambda got: got is not None))
    for name, other in spec.needs.items():
        if (found | given).get(other) is None:
            found.pop(name, None)
    return spec(**found, **given)


@st.composite
def conditions(draw: st.DrawFn, owner: StateSpec, depth: int = 0) -> ConditionSpec:
    names = [name for name in CONDITIONS if depth < 2 or name not in COMBINED]
    name = draw(st.sampled_from([n for n in names if n != "Always" and allowed(n, owner)]))
    given: dict[str, Any] = {"hand_over": False} if name == "ArucoGateFound" else {}
    if name in COMBINED:
        count = draw(st.integers(1, 1 if name == "Not" else 3))
        given["of"] = tuple(draw(conditions(owner, depth + 1)) for _ in range(count))
    return draw(parts(CONDITIONS[name], depth, **given))


def allowed(name: str, owner: StateSpec) -> bool:
    return (name != "Finished" or owner.finishable) and (name != "Unreachable" or owner.targetable)


@st.composite
def drawn(draw: st.DrawFn, depth: int) -> MachineDefinition:
    names = draw(st.lists(ids, min_size=1, max_size=4, unique_by=str))
    kinds = [draw(st.sampled_from(list(STATES))) for _ in names]
    states = [draw(parts(STATES[kind], depth, id=name, final=True)) for kind, name in zip(kinds, names, strict=True)]
    # From a state before it each state is come to; further ways as they come.
    ends = [(draw(st.integers(0, there - 1)), there) for there in range(1, len(states))]
    place = st.integers(0, len(states) - 1)
    ends += draw(st.lists(st.tuples(place, place), max_size=3))
    named = draw(st.lists(ids, min_size=len(ends), max_size=len(ends), unique_by=str))
    ways = [
        TransitionSpec(id=name, source=states[a].id, target=states[b].id, when=draw(conditions(states[a])))
        for name, (a, b) in zip(named, draw(st.permutations(ends)), strict=True)
    ]
    return MachineDefinition(
        root=names[0], name=draw(words), description=draw(words), states=tuple(states), transitions=tuple(ways)
    )


def machines(depth: int = 0) -> st.SearchStrategy[MachineDefinition]:
    """Machines that can run."""
    return drawn(depth).filter(lambda machine: not check(machine))
