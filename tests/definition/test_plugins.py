"""States and conditions of other distributions."""

import sys
import types
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import ClassVar, Literal

import pytest
import toy

from tral_env.errors import MachineError
from tral_fsm import MachinePolicy
from tral_fsm.cli import doctor
from tral_fsm.definition import plugins
from tral_fsm.definition.conditions import CONDITIONS, ConditionSpec
from tral_fsm.definition.machine import STATES, MachineDefinition, StateSpec
from tral_fsm.formats.tral_json import loads
from tral_fsm.states.base import State, register

WOBBLE = '{"root": 0, "states": [{"id": 0, "type": "Wobble", "final": true}]}'


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Iterator[types.ModuleType]:
    """A module of another distribution, and the plugins as if none had been looked for."""
    made = types.ModuleType("wobble_states")
    monkeypatch.setitem(sys.modules, "wobble_states", made)
    plugins.load_plugins.cache_clear()
    yield made
    plugins.load_plugins.cache_clear()
    STATES.unregister("Wobble")


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


TEN_LINES = """
import math
from typing import ClassVar, Literal
from tral_fsm import Command, State, states
from tral_fsm.definition.machine import StateSpec
class WobbleSpec(StateSpec):
    type: Literal["Wobble"] = "Wobble"
@states.register
class Wobble(State[WobbleSpec]):
    def tick(self, estimate):
        return Command(steering=0.3 * math.sin(math.pi * estimate.time), speed=0.5)
"""


def test_a_state_of_ten_lines_in_another_distribution_drives(
    module: types.ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "wobble_states.py").write_text(TEN_LINES)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "wobble_states")
    installed(monkeypatch, "wobble_states")
    world = toy.straight(3.0)
    world.drive(MachinePolicy(loads(WOBBLE)).act, 10.0)
    assert world.speed == pytest.approx(0.5, abs=0.05)
    # it turns left for the first second
    assert max(yaw for _, _, yaw in world.path) > 0.1
    assert world.x > 3.0


def test_a_broken_plugin_is_named_with_its_distribution(
    module: types.ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(monkeypatch, "wobble_states:nothing")
    for _ in range(2):  # it is not forgotten
        with pytest.raises(MachineError, match=r"'wobble' \(wobble_states:nothing\) of the distribution wobble 1\.2"):
            loads(WOBBLE)


def test_a_type_that_is_not_known_says_which_plugins_are_loaded(
    module: types.ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "wobble_states.py").write_text(TEN_LINES)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "wobble_states")
    installed(monkeypatch, "wobble_states")
    hint = r"entry point of the group tral_fsm\.states\. Loaded plugins: wobble_states of wobble 1\.2 with Wobble$"
    with pytest.raises(MachineError, match=hint):
        loads(WOBBLE.replace("Wobble", "Wabble"))


def test_a_plugin_without_a_registered_class_says_so(
    module: types.ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "wobble_states.py").write_text(TEN_LINES.replace("@states.register", ""))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "wobble_states")
    installed(monkeypatch, "wobble_states")
    with pytest.raises(MachineError, match=r"wobble_states of wobble 1\.2 with no type \(no class has @register\)"):
        loads(WOBBLE)


def test_the_doctor_loads_each_plugin(module: types.ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor.opengl, "backends", lambda: ("egl",))  # each starts a Python
    for value, works in (("wobble_states", True), ("wobble_states:nothing", False)):
        entry = EntryPoint("wobble", value, plugins.GROUP)
        monkeypatch.setattr(doctor.metadata, "entry_points", lambda group, entry=entry: [entry])
        (found,) = [finding for finding in doctor.examine() if finding.topic == "plugin"]
        assert (found.name, found.ok, found.needed, bool(found.remedy)) == ("wobble", works, True, not works)


def test_a_type_that_is_taken_is_refused() -> None:
    class MotorSpec(StateSpec):
        type: Literal["Motor"] = "Motor"

    class Motor(State[MotorSpec]):
        pass

    before = STATES["Motor"]
    with pytest.raises(
        MachineError, match=r"calls itself 'Motor', which tral_fsm\.states\.basic\.MotorSpec does already"
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


class TestMembersThatTheSpecAsksFor:
    def test_a_state_that_can_finish_must_say_when(self) -> None:
        class DoneSpec(StateSpec):
            type: Literal["Done"] = "Done"

            @property
            def finishable(self) -> bool:
                return self.final

        class Done(State[DoneSpec]):
            pass

        with pytest.raises(MachineError, match=r"DoneSpec says that it is finishable, but .*Done has no 'finished'"):
            register(Done)
        assert "Done" not in STATES

    def test_a_state_that_takes_a_target_must_have_a_method_for_it(self) -> None:
        class GoalSpec(StateSpec):
            targetable: ClassVar[bool] = True
            type: Literal["Goal"] = "Goal"

        class Goal(State[GoalSpec]):
            pass

        with pytest.raises(MachineError, match=r"GoalSpec says that it is targetable, but .*Goal has no 'set_target'"):
            register(Goal)
        assert "Goal" not in STATES

    def test_a_state_that_holds_a_machine_must_have_a_method_for_it_and_a_parameter(self) -> None:
        class LoopSpec(StateSpec):
            holds_machine: ClassVar[bool] = True
            type: Literal["Loop"] = "Loop"
            machine: MachineDefinition | str

        class Loop(State[LoopSpec]):
            pass

        with pytest.raises(
            MachineError, match=r"LoopSpec says that it is holding a machine, but .*Loop has no 'hold_machine'"
        ):
            register(Loop)
        with pytest.raises(MachineError, match=r"EmptySpec says holds_machine, but has no parameter 'machine'"):

            class EmptySpec(StateSpec):
                holds_machine: ClassVar[bool] = True
                type: Literal["Empty"] = "Empty"


def test_a_class_without_its_spec_in_brackets_is_refused() -> None:
    class Bare(State):  # type: ignore[type-arg]
        pass

    with pytest.raises(
        MachineError, match=r"Bare does not say which spec it runs: .* such as .*Bare\(State\[.*BareSpec\]\)"
    ):
        register(Bare)


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
        CONDITIONS.unregister("Nod")


def test_a_state_is_no_condition() -> None:
    from tral_fsm.conditions import base as conditions
    from tral_fsm.states.basic import Idle

    with pytest.raises(MachineError, match="Idle runs IdleSpec, which is no ConditionSpec"):
        conditions.register(Idle)
    assert "Idle" not in CONDITIONS
