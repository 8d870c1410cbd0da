"""Paths, patterns and ranges of a machine's numbers."""

from __future__ import annotations

import pytest
from courses import NESTED, TWO_WALLS
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from tral_env.errors import ConfigError
from tral_fsm import load_machine
from tral_fsm.definition.machine import MachineDefinition, StateSpec
from tral_fsm.formats.library import names
from tral_fsm.states.wall import FollowWallSpec
from tral_fsm.tuning.parameters import apply, find, sites
from tral_fsm.tuning.ranges import Span, limits, span_of
from tral_fsm.tuning.search.space import from_unit, to_unit


def paths(*patterns: str, machine: MachineDefinition = TWO_WALLS, tie: bool = False) -> list[tuple[str, ...]]:
    return [each.paths for each in find(machine, patterns, tie=tie)]


@pytest.mark.parametrize("name", ["state[right].p", "right.p", "along.p"])
def test_a_state_is_named_by_path_id_or_label(name: str) -> None:
    assert paths(name) == [("state[right].p",)]


def test_a_star_names_every_state_that_has_it() -> None:
    assert paths("*.p") == [("state[right].p",), ("state[left].p",)]


def test_transitions_are_named_by_their_word_alone() -> None:
    assert paths("transition[0].distance") == [("transition[0].distance",)]
    assert paths("transition[*].of[1].distance") == [("transition[end].of[1].distance",)]
    with pytest.raises(ConfigError, match=r"called '\*.distance'"):
        paths("*.distance")


def test_machines_within_states_are_searched_too() -> None:
    assert paths("0/along.p", machine=NESTED) == [("state[0]/state[right].p",)]
    assert len(paths("*.p", machine=NESTED)) == 2


def test_tied_parameters_share_one_value() -> None:
    (tied,) = find(TWO_WALLS, ["*.p"], tie=True)
    assert (tied.label, tied.paths) == ("*.p", ("state[right].p", "state[left].p"))
    changed = apply(TWO_WALLS, [tied], [4.5])
    assert [state.p for state in changed.states if isinstance(state, FollowWallSpec)] == [4.5, 4.5]


def test_a_pattern_that_names_nothing_is_an_error_with_the_nearest_name() -> None:
    with pytest.raises(
        ConfigError, match=r"no parameter of the machine is called 'along.pp': did you mean 'along.p'\?"
    ):
        paths("along.pp")


def test_a_parameter_that_is_null_is_refused_alone_and_passed_over_among_others() -> None:
    with pytest.raises(ConfigError, match=r"state\[right\].throttle is null in the machine"):
        paths("right.throttle")
    assert paths("*.slow*") == [("state[right].slow_speed",), ("state[left].slow_speed",)]


def test_the_same_parameter_twice_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"state\[right\].p is named by both '\*.p' and 'right.p'"):
        paths("*.p", "right.p")


def test_a_range_may_be_given() -> None:
    (p,) = find(TWO_WALLS, ["right.p=0.5:8"])
    assert (p.low, p.high, p.log, p.start) == (0.5, 8.0, True, 1.0)


def test_a_range_beyond_the_definition_is_refused() -> None:
    with pytest.raises(ConfigError, match="allows 1e-06 to 5"):
        find(TWO_WALLS, ["right.clearance=0.2:9"])


def test_without_a_value_or_a_span_a_range_must_be_given() -> None:
    with pytest.raises(ConfigError, match=r"is 0, so its range must be given: state\[stop\].hold=LOW:HIGH"):
        find(load_machine_with_stop(), ["stop.hold"])


def load_machine_with_stop() -> MachineDefinition:
    from tral_fsm.states.basic import StopSpec

    return MachineDefinition(root="stop", states=(StopSpec(id="stop"),))


def test_whole_numbers_and_choices_say_so() -> None:
    kinds = {
        each.label: each.kind
        for each in find(TWO_WALLS, ["right.side", "right.at_most_half", "transition[end].of[0].readings"])
    }
    assert list(kinds.values()) == ["choice", "choice", "int"]
    (side,) = find(TWO_WALLS, ["right.side"])
    assert side.choices == ("left", "right")


def test_the_limits_are_those_of_the_definition() -> None:
    assert limits(FollowWallSpec, "p") == (0.0, 1000.0)
    low, high = limits(FollowWallSpec, "clearance")
    assert 0.0 < low < 2e-6
    assert high == 5.0


def test_a_spec_may_say_where_to_look() -> None:
    class HumSpec(StateSpec):
        pitch: float = Field(440.0, json_schema_extra={"unit": "Hz", "tune": [20.0, 20000.0]}, ge=0.0)

    assert span_of(HumSpec, "pitch", 440.0) == Span(20.0, 20000.0, True)


def test_the_span_holds_the_value_that_is_there() -> None:
    span = span_of(FollowWallSpec, "d", 30.0)
    assert span is not None
    assert span.high == 30.0


@pytest.mark.parametrize("name", names())
def test_every_number_of_the_packaged_machines_stays_what_it_is(name: str) -> None:
    machine = load_machine(name)
    patterns = [site.path for site in sites(machine) if isinstance(site.value, float) and site.value]
    found = find(machine, patterns)
    assert apply(machine, found, [each.sites[0].value for each in found]) == machine  # type: ignore[misc]


def test_values_that_the_definition_does_not_allow_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"cannot be used: p: .* greater than or equal to 0"):
        apply(TWO_WALLS, find(TWO_WALLS, ["right.p"]), [-1.0])


@given(st.floats(0.0, 1.0))
def test_places_in_a_range_and_values_are_one_to_one(place: float) -> None:
    for parameter in find(TWO_WALLS, ["right.p", "right.speed"]):
        value = from_unit(parameter, place)
        assert parameter.low <= value <= parameter.high
        assert to_unit(parameter, value) == pytest.approx(place, abs=2e-3)


def test_a_scale_of_factors_has_its_geometric_mean_in_the_middle() -> None:
    (p,) = find(TWO_WALLS, ["right.p=0.5:8"])
    assert from_unit(p, 0.5) == 2.0


def test_a_choice_begins_at_what_it_is_also_where_that_is_no() -> None:
    (half,) = find(TWO_WALLS, ["right.at_most_half"])
    assert (half.start, half.before) == (False, False)


def test_what_it_was_is_told_apart_from_where_a_search_may_begin() -> None:
    (p,) = find(TWO_WALLS, ["right.p=2:8"])
    assert (p.before, p.start) == (1.0, 2.0)


def test_what_shares_a_value_has_one_name_and_the_limits_of_all() -> None:
    with pytest.raises(ConfigError, match=r"'right\.\*d' names speed, d, slow_speed, which cannot share one value"):
        find(TWO_WALLS, ["right.*d"], tie=True)

    class TameSpec(StateSpec):
        p: float = Field(1.0, ge=0.0, le=2.0)

    tame = TWO_WALLS.model_copy(update={"states": (*TWO_WALLS.states, TameSpec(id="tame", type="Tame"))})
    (p,) = find(tame, ["*.p"], tie=True)
    assert (p.low, p.high) == (0.2, 2.0)
    with pytest.raises(ConfigError, match="allows 0 to 2"):
        find(tame, ["*.p=1:5"], tie=True)


def test_states_of_ones_own_may_hold_what_cannot_be_searched() -> None:
    class OddSpec(StateSpec):
        speed: float = Field(0.2, le=0.2, gt=0.0)
        angles: tuple[float, ...] = (1.0, 2.0)
        turns: int | None = Field(3, ge=1)

    odd = MachineDefinition(root=0, states=(OddSpec(id=0, type="Odd"),))
    turns, speed = find(odd, ["0.turns", "0.speed"])
    assert turns.kind == "int"
    assert (speed.low, speed.high) == (0.05, 0.2)  # the usual span is beyond the limits
    with pytest.raises(ConfigError, match=r"state\[0\]\.angles = \(1.0, 2.0\) is neither a number"):
        find(odd, ["0.angles"])
    assert [each.label for each in find(odd, ["*"])] == ["state[0].speed"]
