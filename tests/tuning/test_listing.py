"""The parameters of a machine for a reader, and those that are searched by default."""

from __future__ import annotations

import json

import pytest
from courses import TWO_WALLS
from typer.testing import CliRunner

from tral_env.errors import ConfigError
from tral_fsm import load_machine
from tral_fsm.cli import app
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.formats.library import names
from tral_fsm.states.basic import StopSpec
from tral_fsm.tuning.listing import default_patterns, listing
from tral_fsm.tuning.parameters import find


@pytest.mark.parametrize("name", names())
def test_every_packaged_machine_has_something_to_tune_without_a_word(name: str) -> None:
    machine = load_machine(name)
    found = find(machine, default_patterns(machine))
    assert {site.name for each in found for site in each.sites} in ({"p", "d"}, {"speed"})


def test_gains_are_searched_by_default_and_speeds_where_there_are_none() -> None:
    assert default_patterns(load_machine("wall")) == ["state[0].p", "state[0].d"]
    assert default_patterns(load_machine("doors")) == ["state[follow].speed"]


def test_a_machine_with_neither_is_told_what_to_name() -> None:
    with pytest.raises(ConfigError, match="neither gains nor speeds: name parameters"):
        default_patterns(MachineDefinition(root="stop", states=(StopSpec(id="stop"),)))


def test_a_list_has_value_unit_range_and_place() -> None:
    by_path = {each.path: each for each in listing(TWO_WALLS)}
    p = by_path["state[right].p"]
    assert (p.name, p.where, p.value, p.unit, p.is_default) == ("along.p", "FollowWall", 1.0, "1/m", True)
    assert p.parameter is not None
    assert (p.parameter.low, p.parameter.high) == (0.2, 20.0)
    assert not by_path["state[right].speed"].is_default
    assert by_path["transition[0].distance"].where == "Distance"
    assert "state[right].throttle" not in by_path  # it is null


@pytest.mark.parametrize("name", names())
def test_all_that_is_listed_with_a_range_can_be_searched(name: str) -> None:
    machine = load_machine(name)
    ranged = [each for each in listing(machine) if each.parameter is not None]
    assert find(machine, [each.path for each in ranged]) == [each.parameter for each in ranged]


def test_the_command_lists_them() -> None:
    shown = CliRunner().invoke(app, ["tune", "--list-params", "--policy", "wall"])
    assert shown.exit_code == 0
    rows = [line.split() for line in shown.stdout.splitlines()]
    assert ["*", "follow.p", "7.519", "1/m", "0.2", "to", "20,", "by", "factors"] in rows
    assert ["follow.side", "right", "left,", "right"] in rows


def test_what_has_no_range_says_how_to_give_one() -> None:
    shown = CliRunner().invoke(app, ["tune", "--list-params", "--policy", "known_route"])
    (row,) = (line for line in shown.stdout.splitlines() if " gate.heading_deg " in line)
    assert row.rstrip().endswith("give one: NAME=LOW:HIGH")


def test_the_command_lists_them_as_json() -> None:
    shown = CliRunner().invoke(app, ["tune", "--list-params", "--json", "--policy", "wall"])
    by_path = {each["path"]: each for each in json.loads(shown.stdout)}
    assert by_path["state[0].speed"] == {
        "path": "state[0].speed", "name": "follow.speed", "type": "BasicFollowWall", "value": 0.7, "unit": "m/s",
        "range": [0.3, 1.6], "default": False,
    }  # fmt: skip
    assert by_path["state[0].side"]["range"] == ["left", "right"]
    route = CliRunner().invoke(app, ["tune", "--list-params", "--json", "--policy", "known_route"])
    assert {each["range"] is None for each in json.loads(route.stdout) if each["name"] == "gate.heading_deg"} == {True}
