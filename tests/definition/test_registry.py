"""Which types of states and conditions machine files may name."""

import subprocess
import sys
from pathlib import Path

import pytest

from tral_fsm.conditions import BUILT_IN as CONDITIONS_BUILT_IN
from tral_fsm.conditions import CONDITIONS
from tral_fsm.definition.machine import StateSpec
from tral_fsm.definition.registry import Registry
from tral_fsm.definition.validated import type_name
from tral_fsm.states import BUILT_IN, STATES
from tral_fsm.states.basic import Idle, IdleSpec, Stop

ROOT = Path(__file__).parents[2]

WITHOUT_THE_FRONT_DOOR = """
import sys, types
package = types.ModuleType("tral_fsm")
package.__path__ = [sys.argv[1]]
sys.modules["tral_fsm"] = package
from tral_fsm.definition import checks, prose, schema
print("tral_fsm.states" in sys.modules)
from tral_fsm import conditions, states
print(len(schema.STATES), len(schema.CONDITIONS))
"""


def test_the_built_in_types_stand_in_the_order_in_which_they_are_listed() -> None:
    assert list(STATES.values())[: len(BUILT_IN)] == [state.spec_type for state in BUILT_IN]
    assert list(CONDITIONS.values())[: len(CONDITIONS_BUILT_IN)] == [it.spec_type for it in CONDITIONS_BUILT_IN]


def test_each_type_stands_below_its_own_name_and_has_a_class_that_runs_it() -> None:
    for known in (STATES, CONDITIONS):
        assert [type_name(spec) for spec in known.values()] == list(known)
        assert [known.runtime(name).spec_type for name in known] == list(known.values())


def test_a_type_that_is_taken_out_is_not_known_any_more() -> None:
    known = Registry(StateSpec)
    known.register_all([Stop, Idle])
    known.unregister("Stop")
    known.unregister("Stop")
    assert dict(known) == {"Idle": IdleSpec}
    with pytest.raises(KeyError):
        known.runtime("Stop")


def test_only_the_front_door_registers_types() -> None:
    command = [sys.executable, "-c", WITHOUT_THE_FRONT_DOOR, str(ROOT / "tral_fsm")]
    out = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert out.stdout.split() == ["False", "0", "0"]
