"""States and conditions of other distributions."""

import sys
import types
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from typing import Literal

import pytest

from tral_env.errors import MachineError
from tral_fsm.definition import plugins
from tral_fsm.definition.conditions import CONDITIONS, ConditionSpec
from tral_fsm.definition.machine import STATES, StateSpec
from tral_fsm.formats.tral_json import loads
from tral_fsm.states.base import RUNTIMES, State, register

WOBBLE = '{"root": 0, "states": [{"id": 0, "type": "Wobble", "final": true}]}'


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Iterator[types.ModuleType]:
    """A module of another distribution, and the plugins as if none had been looked for."""
    made = types.ModuleType("wobble_states")
    monkeypatch.setitem(sys.modules, "wobble_states", made)
    plugins.load_plugins.cache_clear()
    yield made
    plugins.load_plugins.cache_clear()
    STATES.pop("Wobble", None)
    RUNTIMES.pop("Wobble", None)


def installed(monkeypatch: pytest.MonkeyPatch, value: str) -> list[str]:
    """Pretend that a distribution has an entry point; gives the groups that are asked for."""
    asked: list[str] = []

    class Distribution:
        name, version = "wobble", "1.2"

    class Entry(EntryPoint):
        dist = Distribution()  # type: ignore[assignment]

    def entry_points(group: str) -> list[EntryPoint]:
        asked.append(group)
        return [Entry("wobble", value, group)]

    monkeypatch.setattr(plugins, "entry_points", entry_points)
    return asked


def test_a_state_of_another_distribution_is_known_when_a_machine_is_read(
    module: types.ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    def imported() -> None:
        class WobbleSpec(StateSpec):
            type: Literal["Wobble"] = "Wobble"

        @register
        class Wobble(State[WobbleSpec]):
            pass

    class Lazy:  # importing a module runs it; here its entry is looked up
        def __getattr__(self, name: str) -> object:
            imported()
            return object()

    monkeypatch.setitem(sys.modules, "wobble_states", Lazy())  # type: ignore[arg-type]
    asked = installed(monkeypatch, "wobble_states:states")
    assert loads(WOBBLE).states[0].type == "Wobble"
    loads(WOBBLE)
    assert asked == ["tral_fsm.states"]


def test_a_broken_plugin_is_named_with_its_distribution(
    module: types.ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(monkeypatch, "wobble_states:nothing")
    for _ in range(2):  # it is not forgotten
        with pytest.raises(MachineError, match=r"'wobble' \(wobble_states:nothing\) of the distribution wobble 1\.2"):
            loads(WOBBLE)


def test_a_type_that_is_taken_is_refused() -> None:
    class MotorSpec(StateSpec):
        type: Literal["Motor"] = "Motor"

    class Motor(State[MotorSpec]):
        pass

    before = STATES["Motor"]
    with pytest.raises(
        MachineError, match=r"calls itself 'Motor', which tral_fsm\.definition\.machine\.MotorSpec does already"
    ):
        register(Motor)
    assert STATES["Motor"] is before


def test_a_class_without_a_type_is_refused() -> None:
    class NamelessSpec(StateSpec):
        pass

    class Nameless(State[NamelessSpec]):
        pass

    with pytest.raises(MachineError, match="NamelessSpec does not say its type"):
        register(Nameless)


def test_a_class_may_be_defined_anew_under_its_name() -> None:
    from tral_fsm.conditions import base as conditions

    def define() -> type[ConditionSpec]:
        class NodSpec(ConditionSpec):
            type: Literal["Nod"] = "Nod"

        @conditions.register
        class Nod(conditions.Condition[NodSpec]):
            pass

        return NodSpec

    try:
        define()
        again = define()
        assert CONDITIONS["Nod"] is again
    finally:
        del CONDITIONS["Nod"], conditions.RUNTIMES["Nod"]
