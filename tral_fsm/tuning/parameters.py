"""Parameters of a machine by path: those that a pattern names, their ranges, and the machine with other values.

A path is `state[3].p` for a state, `transition[7].distance` or `transition[7].of[0].below` for a transition, and
`state[outer]/state[3].p` in an inner machine.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from pydantic import ValidationError

from tral_env.errors import ConfigError, nearest
from tral_fsm.definition.checks import check
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.definition.validated import Spec, unit_of
from tral_fsm.tuning.ranges import Span, limits, span_of

Value = float | int | bool | str
Place = tuple[str | int, ...]
"""Keys and indices that lead to a parameter in the definition."""
_NEVER = ("type", "id", "label", "final", "machine", "of", "ids", "hand_over")


@dataclass(frozen=True, kw_only=True)
class Site:
    """One parameter of a machine."""

    path: str
    """Path, such as `state[3].p`."""
    names: tuple[str, ...]
    """Names that a pattern may use: the path, and short names by id and label."""
    place: Place
    spec: type[Spec]
    name: str
    value: Value | None

    @property
    def unit(self) -> str:
        """Unit of its value; empty without one."""
        return unit_of(self.spec, self.name)


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A searched number or choice, for one or several sites."""

    label: str
    """Path of its site; for several sites the pattern that names them."""
    sites: tuple[Site, ...]
    unit: str
    kind: Literal["float", "int", "choice"]
    low: float = 0.0
    high: float = 1.0
    log: bool = False
    choices: tuple[Value, ...] = ()
    start: Value = 0.0
    """Value at which a search begins: `before`, clipped to the range."""

    @property
    def before(self) -> Value:
        """Value in the machine; for several sites their median."""
        return _middle(self.sites)

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of its sites."""
        return tuple(site.path for site in self.sites)

    def record(self) -> dict[str, Any]:
        """As plain values, for the files of a study."""
        ends = {"choices": list(self.choices)} if self.kind == "choice" else {"low": self.low, "high": self.high}
        return {"label": self.label, "paths": list(self.paths), "unit": self.unit, "kind": self.kind, **ends} | {
            "log": self.log,
            "start": self.start,
        }


def sites(machine: MachineDefinition) -> list[Site]:
    """All parameters of a machine that a search may name, in the order of the file, also those that are null."""
    return list(_machine_sites(machine, (), [""]))


def _machine_sites(machine: MachineDefinition, place: Place, before: list[str]) -> Iterator[Site]:
    for k, state in enumerate(machine.states):
        calls = [f"state[{state.id}]", str(state.id), *([state.label] if state.label else [])]
        names = [f"{outer}{call}" for outer in before for call in calls]
        yield from _spec_sites(state, (*place, "states", k), names)
        if isinstance(state.inner, MachineDefinition):
            yield from _machine_sites(state.inner, (*place, "states", k, "machine"), [f"{name}/" for name in names])
    for k, transition in enumerate(machine.transitions):
        names = [f"{outer}transition[{transition.id}]" for outer in before]
        yield from _spec_sites(transition.when, (*place, "transitions", k, "when"), names)


def _spec_sites(spec: Spec, place: Place, names: list[str]) -> Iterator[Site]:
    for name in type(spec).model_fields:
        if name not in _NEVER:
            called = tuple(f"{each}.{name}" for each in names)
            yield Site(
                path=called[0],
                names=called,
                place=(*place, name),
                spec=type(spec),
                name=name,
                value=getattr(spec, name),
            )
    for k, part in enumerate(spec.parts if isinstance(spec, ConditionSpec) else ()):
        yield from _spec_sites(part, (*place, "of", k), [f"{each}.of[{k}]" for each in names])


def find(machine: MachineDefinition, patterns: Sequence[str], *, tie: bool = False) -> list[Parameter]:
    """The parameters that patterns name.

    Args:
        machine: the machine.
        patterns: paths or short names (`state[3].p`, `3.p`, `follow.p`); `*` stands for anything, so `*.p` for the p of
            every state, but for transitions only behind `transition`. `=LOW:HIGH` behind it gives a range. Parameters
            that are null in the machine are passed over unless named alone.
        tie: give all parameters of one pattern the same value.

    Raises:
        ConfigError: a pattern names nothing, or what cannot be searched; two patterns name the same parameter; or the
            patterns are a text instead of a list of texts.
    """
    if isinstance(patterns, str):
        raise ConfigError(f"parameters = {patterns!r}: expected a list of patterns, such as [{patterns!r}]")
    known = sites(machine)
    found: list[Parameter] = []
    taken: dict[str, str] = {}
    for pattern in patterns:
        name, ends = _split(pattern)
        matched = _matching(known, name)
        for site in matched:
            if site.path in taken:
                raise ConfigError(f"{site.path} is named by both '{taken[site.path]}' and '{name}': give it once")
            taken[site.path] = name
        groups = [matched] if tie else [[site] for site in matched]
        found += [_parameter(group, name if len(group) > 1 else group[0].path, ends) for group in groups]
    if not found:
        raise ConfigError("no parameters were named: expected paths such as state[0].p or *.p")
    return found


def searchable(site: Site) -> Parameter | None:
    """The parameter of a site alone; None if it is null, needs a range, or cannot be searched."""
    try:
        return None if site.value is None else _parameter([site], site.path, None)
    except ConfigError:
        return None


def _split(pattern: str) -> tuple[str, tuple[float, float] | None]:
    """Name and range of a pattern."""
    name, equals, span = pattern.strip().partition("=")
    if not equals:
        return name, None
    low, _, high = span.partition(":")
    try:
        ends = float(low), float(high)
    except ValueError:
        raise ConfigError(f"{pattern}: expected LOW:HIGH behind =, such as {name}=0.5:8") from None
    if not (math.isfinite(ends[0]) and math.isfinite(ends[1])):
        raise ConfigError(f"{pattern}: expected finite numbers, such as {name}=0.5:8")
    if not ends[0] < ends[1]:
        raise ConfigError(f"{pattern}: expected the lower end first")
    return name, ends


def _matching(known: Sequence[Site], pattern: str) -> list[Site]:
    regex = re.compile(re.escape(pattern).replace(r"\*", ".*").replace(r"\?", "."))
    wild = "*" in pattern or "?" in pattern
    of_transitions = "transition" in pattern
    here = [site for site in known if of_transitions or not site.path.rpartition("/")[2].startswith("transition")]
    matched = [site for site in here if any(regex.fullmatch(name) for name in site.names)]
    if not matched:
        allowed = [site.names[-1] for site in here if site.value is not None]
        raise ConfigError(f"no parameter of the machine is called '{pattern}': {nearest(pattern, allowed)}")
    usable = [site for site in matched if site.value is not None]
    if not usable:
        raise ConfigError(f"{matched[0].path} is null in the machine: give it a value there first")
    if wild:
        usable = [site for site in usable if _kind(site) == "float"] or usable
    return usable


def _kind(site: Site) -> Literal["float", "int", "choice"]:
    if isinstance(site.value, bool) or not isinstance(site.value, int | float):
        return "choice"
    declared = _declared(site)
    return "int" if int in (declared, *get_args(declared)) and isinstance(site.value, int) else "float"


def _middle(group: Sequence[Site]) -> Value:
    values = [site.value for site in group if site.value is not None]
    if _kind(group[0]) == "choice":
        return values[0]
    return sorted(values, key=float)[len(values) // 2]


def is_optional_number(site: Site) -> bool:
    """Whether a parameter is a number that may be null."""
    told = get_args(_declared(site))
    return type(None) in told and (float in told or int in told)


def _declared(site: Site) -> Any:
    return site.spec.model_fields[site.name].annotation


def _parameter(group: Sequence[Site], label: str, ends: tuple[float, float] | None) -> Parameter:
    first = group[0]
    kinds = {_kind(site) for site in group}
    if len(kinds) > 1:
        raise ConfigError(f"'{label}' names numbers and choices together: name them apart")
    if len({site.name for site in group}) > 1:
        names = ", ".join(dict.fromkeys(site.name for site in group))
        raise ConfigError(f"'{label}' names {names}, which cannot share one value: give a pattern for each")
    kind = kinds.pop()
    unit = first.unit
    if kind == "choice":
        choices = tuple(each for each in _choices(first) if all(each in _choices(site) for site in group))
        return Parameter(label=label, sites=tuple(group), unit=unit, kind=kind, choices=choices, start=_middle(group))
    middle = float(_middle(group))
    allowed_ends = [limits(site.spec, site.name) for site in group]
    lowest, highest = max(low for low, _ in allowed_ends), min(high for _, high in allowed_ends)
    span = span_of(first.spec, first.name, middle)
    if ends is None and span is not None:
        span = Span(max(span.low, lowest), min(span.high, highest), span.log)
    if ends is not None:
        if ends[0] < lowest or ends[1] > highest:
            raise ConfigError(f"{label}={ends[0]:g}:{ends[1]:g}: the definition allows {lowest:.6g} to {highest:.6g}")
        span = Span(*ends, log=span is not None and span.log and ends[0] > 0.0)
    if span is None or not span.low < span.high:
        raise ConfigError(f"{label} is {middle:g}, so its range must be given: {label}=LOW:HIGH")
    start = min(max(middle, span.low), span.high)
    return Parameter(
        label=label,
        sites=tuple(group),
        unit=unit,
        kind=kind,
        low=span.low,
        high=span.high,
        log=span.log,
        start=round(start) if kind == "int" else start,
    )


def _choices(site: Site) -> tuple[Value, ...]:
    declared = _declared(site)
    if declared is bool:
        return (False, True)
    if get_origin(declared) is Literal:
        return tuple(get_args(declared))
    raise ConfigError(f"{site.path} = {site.value!r} is neither a number nor one of a few words: it cannot be searched")


def apply(
    machine: MachineDefinition, parameters: Sequence[Parameter], values: Sequence[Value | None]
) -> MachineDefinition:
    """The machine with other values.

    Args:
        machine: the machine.
        parameters: the parameters to change.
        values: a value for each parameter.

    Raises:
        ConfigError: the definition does not allow the values.
    """
    changes = {
        site.place: value for parameter, value in zip(parameters, values, strict=True) for site in parameter.sites
    }
    try:
        changed: MachineDefinition = _rebuilt(machine, changes)
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors())
        raise ConfigError(f"these values cannot be used: {faults}") from error
    problems = check(changed)
    if problems:
        raise ConfigError(f"these values cannot be used: {problems[0]}")
    return changed


def with_value(machine: MachineDefinition, path: str, value: Value | None) -> MachineDefinition:
    """The machine with another value of one parameter, which may be null before and, where it is allowed, after.

    Raises:
        ConfigError: it has no such parameter, or the definition does not allow the value.
    """
    known = {site.path: site for site in sites(machine)}
    if path not in known:
        raise ConfigError(f"no parameter of the machine is called '{path}': {nearest(path, known)}")
    site = known[path]
    return apply(machine, [Parameter(label=path, sites=(site,), unit=site.unit, kind="float")], [value])


def allowed(machine: MachineDefinition, parameters: Sequence[Parameter], values: Sequence[Value]) -> bool:
    """Whether the definition allows the machine with these values."""
    try:
        apply(machine, parameters, values)
    except ConfigError:
        return False
    return True


def _rebuilt(part: Any, changes: Mapping[Place, Value | None]) -> Any:
    """A part of a definition with changes in it, whose places are relative to the part."""
    if () in changes:
        return changes[()]
    heads = {place[0] for place in changes}
    inside = {head: {place[1:]: value for place, value in changes.items() if place[0] == head} for head in heads}
    if isinstance(part, tuple):
        return tuple(_rebuilt(item, inside[k]) if k in inside else item for k, item in enumerate(part))
    updated = {name: _rebuilt(getattr(part, str(name)), inner) for name, inner in inside.items()}
    return type(part)(**{name: getattr(part, name) for name in type(part).model_fields} | updated)
