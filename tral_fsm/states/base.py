"""What every state is: it gets the estimate of a tick, and answers with a command.

A state of your own: derive a spec from `definition.machine.StateSpec` and a class from `State`, and decorate the class
with `register`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Generic, Protocol, TypeVar, get_args, runtime_checkable

from tral_env.se2 import Pose
from tral_fsm.control.command import IDLE, Command
from tral_fsm.definition.machine import STATES, DrivingSpec, StateSpec
from tral_fsm.definition.validated import register_type
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate

S = TypeVar("S", bound=StateSpec)
D = TypeVar("D", bound=DrivingSpec)

NO_CLEARANCE = (math.nan, math.nan)
"""No clearance is kept."""
NO_GATE = -1
"""Id of a target that is no gate."""


@runtime_checkable
class Finishable(Protocol):
    """A state that can say that it is finished."""

    @property
    def finished(self) -> bool:
        """Its work is done."""
        ...


@runtime_checkable
class Targetable(Protocol):
    """A state that can be handed a target point at run time."""

    def set_target(self, estimate: CarEstimate, target: Pose, gate: int = NO_GATE) -> None:
        """Take a target, right after entry.

        Args:
            estimate: of this tick.
            target: x [m] ahead of the car now, y [m] left of it, direction [rad] in which it is to be passed.
            gate: id of the gate that it is, or -1.
        """
        ...


class State(Generic[S]):
    """Base of all states at work. `State[MySpec]` says which type of machine files a class runs."""

    spec_type: ClassVar[type[StateSpec]]
    """The spec that this class runs; taken from the brackets behind `State`."""
    aim: Detection | None = None
    """A gate that the state has chosen as its target at entry, though nothing was handed over."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.spec_type = spec_in(cls, StateSpec) or getattr(cls, "spec_type", StateSpec)

    def __init__(self, spec: S) -> None:
        self.spec = spec

    def on_enter(self, estimate: CarEstimate) -> None:
        """Called when the state becomes active."""

    def tick(self, estimate: CarEstimate) -> Command:
        """The command of this tick."""
        return IDLE

    def on_exit(self, estimate: CarEstimate) -> None:
        """Called when the state is left."""

    def unreachable(self, estimate: CarEstimate) -> str:
        """Why a targetable state cannot come to its target any more; empty: it can."""
        return ""


def spec_in(cls: type, base: type) -> Any:
    """The spec in the brackets of a class's bases, as in `State[MySpec]`; None if there is none, or a type variable."""
    for generic in getattr(cls, "__orig_bases__", ()):
        for argument in get_args(generic):
            if isinstance(argument, type) and issubclass(argument, base):
                return argument
    return None


RUNTIMES: dict[str, type[State[Any]]] = {}
"""The class that runs each type of state."""

R = TypeVar("R", bound=type[State[Any]])


def register(state: R) -> R:
    """Let machine files name a class of states from now on; also a decorator.

    Raises:
        MachineError: another class has its type already, or its spec says none.
    """
    RUNTIMES[register_type(STATES, state.spec_type)] = state
    return state


class DrivingState(State[D]):
    """A state that moves the car, with the speed or the throttle of its spec."""

    def drive(
        self,
        steering: float,
        speed: float | None = None,
        *,
        wanted: tuple[float, float] = NO_CLEARANCE,
    ) -> Command:
        """A command with the spec's throttle, or with the speed given [m/s], or with the spec's.

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
        return Command(steering, speed, throttle, spec.steering_trim, *wanted)
