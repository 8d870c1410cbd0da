"""What a machine is, as plain validated data: states, transitions between them, and the state that it starts in.

Here stands what every state has in common. The types of states stand in `tral_fsm.states`, each beside the class that
runs it; `STATES` lists them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

from pydantic import Field, SerializeAsAny

from tral_env.errors import MachineError
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.needs import HALL, NOTHING
from tral_fsm.definition.registry import Registry
from tral_fsm.definition.validated import Id, Spec, quantity


class StateSpec(Spec):
    """Base of the specs of all states. A spec of your own derives from it and gives its name in `type`."""

    targetable: ClassVar[bool] = False
    """The state takes a target point at run time."""
    holds_machine: ClassVar[bool] = False
    """The member `machine` is a machine, or the name of a packaged one; the engine gives it to the state at work."""
    never_finishes_hint: ClassVar[str] = ""
    """Why the state never finishes. An error says it where a transition waits for the end of the state."""

    type: str
    id: Id
    label: str = Field("", description="what the state is for, in your words")
    final: bool = Field(False, description="the machine may end here: the state needs no way out")

    @classmethod
    def can_finish(cls) -> bool:
        """Whether states of this type can say that they are finished, at least with some parameters."""
        return cls.finishable is not StateSpec.finishable

    @classmethod
    def can_take_target(cls) -> bool:
        """Whether states of this type can be handed a target, at least with some parameters."""
        return cls.targetable or cls.takes_target is not StateSpec.takes_target

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        if cls.holds_machine and "machine" not in cls.model_fields:
            raise MachineError(
                f"{cls.__qualname__} says holds_machine, but has no parameter 'machine': "
                "write machine: MachineDefinition | str into it"
            )

    @classmethod
    def required_members(cls) -> Mapping[str, str]:
        """`finished` to finish, `set_target` to take a target, `hold_machine` to hold a machine."""
        members = {"finished": "finishable"} if cls.can_finish() else {}
        members |= {"set_target": "targetable"} if cls.can_take_target() else {}
        return members | ({"hold_machine": "holding a machine"} if cls.holds_machine else {})

    @property
    def finishable(self) -> bool:
        """Whether the state can say that it is finished."""
        return False

    @property
    def takes_target(self) -> bool:
        """Whether the state can be handed a target: its type can, or the machine that it holds."""
        return self.targetable

    @property
    def may_end(self) -> bool:
        """Whether the machine may end here, so that no transition needs to leave the state."""
        return self.final

    @property
    def inner(self) -> MachineDefinition | str | None:
        """The machine that the state holds, or the name of a packaged one; None: the state holds none."""
        machine: MachineDefinition | str | None = getattr(self, "machine") if self.holds_machine else None  # noqa: B009
        return machine

    @property
    def readings_needed(self) -> frozenset[str]:
        """Readings without which the state does not do what it says, as `tral_env.interface.CORE_FIELDS` names them."""
        return NOTHING


def steering_trim() -> Any:
    """The parameter `steering_trim` of a state that moves the car."""
    return quantity(0.0, "", "added to the steering of a car that does not run straight", ge=-1.0, le=1.0)


class DrivingSpec(StateSpec):
    """A state that moves the car, with a speed (regulated) or with a throttle (open loop)."""

    exactly_one: ClassVar[tuple[str, ...]] = ("speed", "throttle")

    speed: float | None = quantity(None, "m/s", "regulated by what the hall sensor measures", ge=0.0, le=5.0)
    throttle: float | None = quantity(None, "", "fixed, open loop, as in 2016", ge=-1.0, le=1.0)
    steering_trim: float = steering_trim()

    @property
    def readings_needed(self) -> frozenset[str]:
        """A speed is regulated on the hall sensor; a throttle needs nothing."""
        return NOTHING if self.speed is None else HALL


class TransitionSpec(Spec):
    """A transition from one state to another. In a file the members of its condition stand beside id, from and to."""

    id: Id
    source: Id = Field(alias="from")
    target: Id = Field(alias="to")
    when: SerializeAsAny[ConditionSpec]


class MachineDefinition(Spec):
    """A machine: its states, its transitions in the order in which they are checked, and its root."""

    root: Id = Field(description="id of the state in which the machine starts")
    name: str = ""
    description: str = ""
    states: tuple[SerializeAsAny[StateSpec], ...]
    transitions: tuple[TransitionSpec, ...] = ()

    @property
    def may_end(self) -> bool:
        """Whether some state may end the machine and has no transition that leaves it."""
        left = {transition.source for transition in self.transitions}
        return any(state.may_end and state.id not in left for state in self.states)


STATES = Registry(StateSpec)
"""Every known type of state. Importing `tral_fsm` adds those of the package, `states.register` any other."""

Load = Callable[[str], MachineDefinition]
"""Gives the packaged machine of a name, without looking into it."""


def machines_within(machine: MachineDefinition, load: Load) -> Iterator[MachineDefinition]:
    """A machine, and all that its states hold.

    Args:
        machine: a definition that can run.
        load: for the packaged machines that the machine names.
    """
    yield machine
    for state in machine.states:
        inner = load(state.inner) if isinstance(state.inner, str) else state.inner
        if inner is not None:
            yield from machines_within(inner, load)


def needed_readings(machine: MachineDefinition, load: Load) -> frozenset[str]:
    """Readings without which a machine cannot drive as its file says: those of all its parts, inner machines included.

    Args:
        machine: a definition that can run.
        load: for the packaged machines that the machine names.

    Returns:
        Names out of `tral_env.interface.CORE_FIELDS`.
    """
    needed: set[str] = set()
    conditions: list[ConditionSpec] = []
    for each in machines_within(machine, load):
        needed.update(*(state.readings_needed for state in each.states))
        conditions += [transition.when for transition in each.transitions]
    while conditions:
        condition = conditions.pop()
        needed |= condition.readings_needed
        conditions += condition.parts
    return frozenset(needed)
