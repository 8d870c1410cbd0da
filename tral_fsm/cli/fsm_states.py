"""`tral fsm states`: the states and conditions that a machine may have."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tral_env.errors import ConfigError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rich.table import Table

    from tral_fsm.definition.conditions import ConditionSpec
    from tral_fsm.definition.machine import StateSpec

_WITHOUT = ("type", "id")
_LIMITS = {"minimum": "≥ {:g}", "exclusiveMinimum": "> {:g}", "maximum": "≤ {:g}", "exclusiveMaximum": "< {:g}"}


def command(
    name: Annotated[str | None, typer.Argument(help="Name of a state or condition; default: all.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """List the states and conditions, with the unit, default and range of each parameter."""
    from tral_fsm.conditions import CONDITIONS
    from tral_fsm.definition.plugins import load_plugins
    from tral_fsm.states import STATES

    load_plugins()
    found: dict[str, Mapping[str, type[StateSpec] | type[ConditionSpec]]] = {"states": STATES, "conditions": CONDITIONS}
    if name is not None:
        known = {entry.casefold(): entry for entry in (*STATES, *CONDITIONS)}
        name = known.get(name.casefold(), name)
        if name not in known.values():
            raise ConfigError(f"unknown state or condition '{name}': {nearest(name, known.values())}")
        found = {kind: {name: specs[name]} for kind, specs in found.items() if name in specs}
    entries = {kind: [_entry(label, spec) for label, spec in specs.items()] for kind, specs in found.items()}
    if as_json:
        typer.echo(json.dumps(entries, indent=2))
    elif name is not None:
        _show_one(*(entry for listed in entries.values() for entry in listed))
    else:
        _show_all(entries)


def _entry(name: str, spec: type[StateSpec] | type[ConditionSpec]) -> dict[str, Any]:
    """A type and its parameters as plain values."""
    from tral_fsm.definition.machine import StateSpec

    schema = spec.model_json_schema()
    entry: dict[str, Any] = {"type": name, "description": " ".join((spec.__doc__ or "").split())}
    if issubclass(spec, StateSpec):
        entry["finishable"] = spec.can_finish()
        entry["targetable"] = spec.can_take_target()
    required = schema.get("required", [])
    entry["parameters"] = [
        _parameter(label, members, label in required)
        for label, members in schema["properties"].items()
        if label not in _WITHOUT
    ]
    return entry


def _parameter(name: str, members: Mapping[str, Any], required: bool) -> dict[str, Any]:
    """A parameter as plain values, from its part of the JSON Schema."""
    options = [option for option in members.get("anyOf", [members]) if option.get("type") != "null"]
    merged = {key: value for option in options for key, value in option.items()}
    entry = {"name": name, "description": members.get("description", ""), "unit": members.get("unit", "")}
    entry["required"] = required
    if not required:
        entry["default"] = members.get("default")
    entry |= {limit: merged[limit] for limit in _LIMITS if limit in merged}
    if "enum" in merged:
        entry["allowed"] = merged["enum"]
    return entry


def _default(parameter: Mapping[str, Any]) -> str:
    if parameter["required"]:
        return "required"
    return "none" if parameter["default"] in (None, "", []) else _plain(parameter["default"])


def _plain(value: Any) -> str:
    return json.dumps(value).strip('"') if not isinstance(value, float) else f"{value:g}"


def _range(parameter: Mapping[str, Any]) -> str:
    limits = [text.format(parameter[limit]) for limit, text in _LIMITS.items() if limit in parameter]
    return ", ".join([*limits, *parameter.get("allowed", ())])


def _show_all(entries: Mapping[str, Iterable[Mapping[str, Any]]]) -> None:
    from rich.console import Console

    for kind, listed in entries.items():
        table = _table(kind, "what it does" if kind == "states" else "when it holds", "parameters (default)")
        for entry in listed:
            own = [p for p in entry["parameters"] if p["name"] not in ("label", "final")]
            table.add_row(entry["type"], entry["description"], ", ".join(_short(parameter) for parameter in own))
        Console().print(table)
    typer.echo("One in detail: tral fsm states FollowWall")


def _short(parameter: Mapping[str, Any]) -> str:
    default = _default(parameter)
    unit = f" {parameter['unit']}" if parameter["unit"] else ""
    return f"{parameter['name']}{'' if default in ('required', 'none') else f' ({default}{unit})'}"


def _show_one(entry: Mapping[str, Any]) -> None:
    from rich.console import Console

    Console(highlight=False).print(f"{entry['type']}: {entry['description']}", markup=False)
    if entry.get("finishable"):
        typer.echo("It can say that it is finished.")
    if entry.get("targetable"):
        typer.echo("It can be handed a target.")
    if not entry["parameters"]:
        typer.echo("It has no parameters.")
        return
    table = _table("parameter", "default", "unit", "range", "meaning")
    for p in entry["parameters"]:
        table.add_row(p["name"], _default(p), p["unit"], _range(p), p["description"])
    Console().print(table)


def _table(*headings: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column(headings[0], no_wrap=True)
    for heading in headings[1:]:
        table.add_column(heading)
    return table
