"""What a machine is, as plain validated data: states, transitions between them, and the state that it starts in.

Here stands what every state has in common. The types of states stand in `tral_fsm.states`, each beside the class that
runs it; `STATES` lists them.
"""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field, SerializeAsAny

from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.registry import Registry
from tral_fsm.definition.validated import Id, Spec, quantity


class StateSpec(Spec):
    """Base of all states. A state of your own derives from it and names itself in `type`."""

    targetable: ClassVar[bool] = False
    """Takes a target point at run time."""
    holds_machine: ClassVar[bool] = False
    """Its member `machine` is a machine, or the name of a packaged one."""
    never_finishes_hint: ClassVar[str] = ""
    """What an error adds where a state that is not finishable is asked whether it is finished: why it is not."""

    type: str
    id: Id
    label: str = Field("", description="what it is for, in your words")
    final: bool = Field(False, description="the machine may end here: the state needs no way out")

    @property
    def finishable(self) -> bool:
        """Can say that it is finished."""
        return False

    @property
    def takes_target(self) -> bool:
        """Can be handed a target: its type can, or what it holds."""
        return self.targetable

    @property
    def may_end(self) -> bool:
        """Needs no transition that leaves it."""
        return self.final

    @property
    def inner(self) -> MachineDefinition | str | None:
        """The machine that it holds, or the name of a packaged one; None: it holds none."""
        return None


class DrivingSpec(StateSpec):
    """A state that moves the car: with a speed (regulated on the hall sensor) or a throttle (open loop)."""

    exactly_one: ClassVar[tuple[str, ...]] = ("speed", "throttle")

    speed: float | None = quantity(None, "m/s", "regulated on the hall sensor", ge=0.0, le=5.0)
    throttle: float | None = quantity(None, "", "open loop, as in 2016", ge=-1.0, le=1.0)
    steering_trim: float = quantity(0.0, "", "added to the steering: a car that does not run straight", ge=-1.0, le=1.0)


class TransitionSpec(Spec):
    """A way from one state to another. In a file the condition's members stand beside id, from and to."""

    id: Id
    source: Id = Field(alias="from")
    target: Id = Field(alias="to")
    when: SerializeAsAny[ConditionSpec]


class MachineDefinition(Spec):
    """A machine: its states, the transitions between them, in the order in which they are checked, and its root."""

    root: Id = Field(description="id of the state in which it starts")
    name: str = ""
    description: str = ""
    states: tuple[SerializeAsAny[StateSpec], ...]
    transitions: tuple[TransitionSpec, ...] = ()

    @property
    def may_end(self) -> bool:
        """There is a state in which it may end: one that may, and has no way out."""
        left = {transition.source for transition in self.transitions}
        return any(state.may_end and state.id not in left for state in self.states)


STATES = Registry(StateSpec)
"""Every known type of state. Importing `tral_fsm.states` adds those of the package, `states.register` any other."""
