"""What every condition has in common: it gets the estimate of a tick and says whether its transition fires.

A condition has a memory of its own (a distance, a timer, readings that agreed). The memory starts again whenever the
machine enters the state that the transition leaves. A condition of your own: derive a spec from
`definition.conditions.ConditionSpec` and a class from `Condition`, and decorate the class with `register`.
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
    """The condition must be asked in every tick, since it counts ticks or readings. False: All and Any skip it where
    another part decides."""

    def __init__(self, spec: C, owner: State[Any]) -> None:
        self.spec = spec
        self.owner = owner
        """The state that the transition leaves."""

    def on_enter(self, estimate: CarEstimate) -> None:
        """Begin: the machine enters the owner."""

    def restart(self) -> None:
        """Forget everything: a new drive begins."""

    def retune(self, spec: C) -> None:
        """Go on with other parameters, in the middle of the state; see `Runtime.adopt`."""
        self.adopt(type(self)(self.spec, self.owner), type(self)(spec, self.owner))

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the transition fires. The machine asks once a tick, after the owner's tick."""
        raise NotImplementedError

    def why(self, estimate: CarEstimate) -> str:
        """The compared values, for the trace."""
        return self.spec.type

    def hand_over(self, estimate: CarEstimate) -> Detection | None:
        """The gate that the next state gets as its target; None: no gate."""
        return None


register = CONDITIONS.register
"""Let machine files name a class of conditions from now on; also a decorator."""


def build(spec: ConditionSpec, owner: State[Any]) -> Condition[Any]:
    """The running condition of a spec."""
    runtime: type[Condition[Any]] = CONDITIONS.runtime(spec.type)
    return runtime(spec, owner)
