"""What every state has in common: it gets the estimate of a tick and answers with a command.

A state of your own: derive a spec from `definition.machine.StateSpec` and a class from `State`, and decorate the class
with `register`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Protocol, TypeVar

from tral_env.se2 import Pose
from tral_fsm.control.command import IDLE, Command
from tral_fsm.definition.machine import STATES, DrivingSpec, StateSpec
from tral_fsm.definition.registry import Runtime
from tral_fsm.definition.validated import Spec
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate

S = TypeVar("S", bound=StateSpec)
D = TypeVar("D", bound=DrivingSpec)

NO_CLEARANCE = (math.nan, math.nan)
"""The state keeps no clearance."""
NO_GATE = -1
"""Id of a target that is no gate."""


class Finishable(Protocol):
    """A state that can say that it is finished."""

    @property
    def finished(self) -> bool:
        """Whether the work of the state is done."""
        ...


class Targetable(Protocol):
    """A state that can be handed a target point at run time."""

    def set_target(self, estimate: CarEstimate, target: Pose, gate: int = NO_GATE) -> None:
        """Take a target, right after entry.

        Args:
            estimate: of this tick.
            target: x [m] ahead of the car now, y [m] left of it, direction [rad] in which the car shall pass it.
            gate: id of the gate at the target; -1: none.
        """
        ...


class InnerMachine(Protocol):
    """What a state may do with the machine that it holds. The engine makes it, restarts it and traces it."""

    @property
    def active(self) -> State[Any]:
        """The active state; the root before the first tick."""
        ...

    @property
    def ended(self) -> bool:
        """The machine has come to its end."""
        ...

    def start(self, estimate: CarEstimate) -> Detection | None:
        """Enter the root."""
        ...

    def tick(self, estimate: CarEstimate) -> Command:
        """The active state's command; afterwards a transition may fire."""
        ...

    def leave(self, estimate: CarEstimate) -> None:
        """Leave the active state."""

    def shadow(self, estimate: CarEstimate) -> None:
        """Tell the active state that another policy drives the car."""


class MachineHolder(Protocol):
    """A state that holds a machine."""

    def hold_machine(self, machine: InnerMachine) -> None:
        """Keep the machine of the spec, before anything else is called."""


class State(Runtime[S]):
    """Base of all states at work. `State[MySpec]` says which type of machine files a class runs."""

    spec_type: ClassVar[type[Spec]] = StateSpec
    own_target: Detection | None = None
    """A gate that the state chose as its target at entry by itself."""

    def __init__(self, spec: S) -> None:
        self.spec = spec

    def on_enter(self, estimate: CarEstimate) -> None:
        """Begin: the state becomes active."""

    def tick(self, estimate: CarEstimate) -> Command:
        """Compute the command of this tick."""
        return IDLE

    def on_exit(self, estimate: CarEstimate) -> None:
        """End: the machine leaves the state."""

    def retune(self, spec: S) -> None:
        """Go on with other parameters, in the middle of the state; see `Runtime.adopt`."""
        self.adopt(type(self)(self.spec), type(self)(spec))

    def on_shadow(self, estimate: CarEstimate) -> None:
        """Another policy drives the car: before each tick, forget what holds only if the car obeys this state."""

    def unreachable(self, estimate: CarEstimate) -> str:
        """Why a targetable state cannot reach its target any more; empty: it can."""
        return ""


register = STATES.register
"""Let machine files name a class of states from now on; also a decorator."""


class DrivingState(State[D]):
    """A state that moves the car, with the speed or the throttle of its spec."""

    def drive(
        self,
        steering: float,
        speed: float | None = None,
        *,
        wanted: tuple[float, float] = NO_CLEARANCE,
    ) -> Command:
        """Make a command with the throttle of the spec or, if it has none, with a speed.

        Args:
            steering: in [-1, 1], + = left.
            speed: m/s; None: that of the spec.
            wanted: wall that a clearance is kept to, +1 left, -1 right, and that clearance, m.
        """
        spec = self.spec
        throttle = spec.throttle
        if throttle is not None:
            speed = None
        elif speed is None:
            speed = spec.speed
        wanted_side, wanted_clearance = wanted
        return Command(steering, speed, throttle, spec.steering_trim, wanted_side, wanted_clearance)
