"""What every condition is: it gets the estimate of a tick, and says whether its transition fires.

A condition has a memory of its own (a distance, a timer, readings that agreed), which starts anew whenever the state
that it leaves is entered. A condition of your own: derive a spec from `definition.conditions.ConditionSpec` and a class
from `Condition`, and decorate the class with `register`.
"""

from __future__ import annotations

from typing import Any, ClassVar, TypeVar

from tral_fsm.definition.conditions import CONDITIONS, ConditionSpec
from tral_fsm.definition.registry import Runtime
from tral_fsm.definition.validated import Spec
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import State

C = TypeVar("C", bound=ConditionSpec)


class Condition(Runtime[C]):
    """Base of all conditions at work. `Condition[MySpec]` says which type of machine files a class runs."""

    spec_type: ClassVar[type[Spec]] = ConditionSpec
    counts: bool = True
    """It must be asked in every tick, since it counts ticks or readings. False: All and Any leave it out where another
    part has settled the matter."""

    def __init__(self, spec: C, owner: State[Any]) -> None:
        self.spec = spec
        self.owner = owner
        """The state that is left."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Called when the owner is entered."""

    def restart(self) -> None:
        """Forget all: a drive begins anew."""

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether to fire; called once a tick, after the owner's tick."""
        raise NotImplementedError

    def why(self, estimate: CarEstimate) -> str:
        """The values that were compared, for the trace."""
        return self.spec.type

    def hand_over(self, estimate: CarEstimate) -> Detection | None:
        """What the next state gets as its target."""
        return None


RUNTIMES: dict[str, type[Condition[Any]]] = CONDITIONS.runtimes
"""Type of condition -> the class that runs it."""
register = CONDITIONS.register
"""Let machine files name a class of conditions from now on; also a decorator."""


def build(spec: ConditionSpec, owner: State[Any]) -> Condition[Any]:
    """The running condition of a spec."""
    return RUNTIMES[spec.type](spec, owner)
