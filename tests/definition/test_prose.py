"""Conditions in words."""

from typing import Literal

from tral_fsm.conditions.combined import AllSpec, AnySpec, CombinedSpec, NotSpec
from tral_fsm.conditions.simple import SensorLevelSpec, TimerSpec
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.prose import combined, in_full, parameters
from tral_fsm.definition.validated import quantity
from tral_fsm.states.wall import FollowWallSpec

WAIT = TimerSpec(seconds=2.0)
NEAR = SensorLevelSpec(below=0.5)
SIDE = SensorLevelSpec(sensor="left", above=1.0, readings=2)


def type_alone(condition: ConditionSpec) -> str:
    return condition.type


def test_in_full_a_value_has_its_name_and_its_unit() -> None:
    assert in_full(WAIT) == "Timer seconds 2.0 s"
    assert in_full(SIDE) == "SensorLevel sensor left above 1.0 m readings 2"


def test_in_full_the_sensor_is_told_even_if_it_is_the_default() -> None:
    assert in_full(NEAR) == "SensorLevel sensor front below 0.5 m"


def test_parts_stand_in_parentheses_only_within_others() -> None:
    either = AnySpec(of=(WAIT, NEAR))
    assert combined(either, type_alone) == "Timer or SensorLevel"
    assert combined(either, type_alone, inside=True) == "(Timer or SensorLevel)"
    assert combined(AllSpec(of=(either, NotSpec(of=(WAIT,)))), type_alone) == "(Timer or SensorLevel) and not Timer"


def test_a_single_part_needs_no_parentheses() -> None:
    assert combined(AllSpec(of=(WAIT,)), type_alone, inside=True) == "Timer"


def test_a_combining_condition_without_words_of_its_own_is_told_by_its_type() -> None:
    class TwoOfSpec(CombinedSpec):
        type: Literal["TwoOf"] = "TwoOf"

    two = TwoOfSpec(of=(WAIT, NEAR, AnySpec(of=(WAIT, NEAR))))
    assert combined(two, type_alone, inside=True) == "TwoOf(Timer, SensorLevel, (Timer or SensorLevel))"


def test_a_null_is_no_value_of_its_parameter_unless_the_spec_has_a_word_for_it() -> None:
    spec = FollowWallSpec(id=0, speed=0.5, d=None, max_error=None, max_angle_deg=None)
    assert list(parameters(spec, always=False)) == ["speed 0.5 m/s", "d auto", "no max error", "no max angle"]


def test_a_null_has_no_unit() -> None:
    class PatientSpec(ConditionSpec):
        seconds: float | None = quantity(2.0, "s", "null: for ever")

    patient = PatientSpec(type="Patient", seconds=None)
    assert in_full(patient) == "Patient seconds null"
    assert list(parameters(patient, always=True)) == ["no seconds"]
