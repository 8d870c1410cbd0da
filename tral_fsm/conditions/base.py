"""When transitions fire. Each class runs one condition of `definition`.

A condition has a memory of its own (a distance, a timer, readings that agreed), which starts anew whenever the state
that it leaves is entered.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from tral_fsm.definition.conditions import (
    CONDITIONS,
    AlignedSpec,
    AllSpec,
    AlwaysSpec,
    AnySpec,
    ConditionSpec,
    DistanceSpec,
    FinishedSpec,
    NotSpec,
    SensorLevelSpec,
    TimerSpec,
    TurnedSpec,
    UnreachableSpec,
)
from tral_fsm.definition.validated import register
from tral_fsm.estimation.estimator import MachineState
from tral_fsm.estimation.sonar import Sighting
from tral_fsm.states.base import State

C = TypeVar("C", bound=ConditionSpec)


class Condition(Generic[C]):
    """Base of all running conditions."""

    counts: bool = True
    """It must be asked in every tick, since it counts ticks or readings. False: All and Any leave it out where another
    part has settled the matter."""

    def __init__(self, spec: C, owner: State[Any]) -> None:
        self.spec = spec
        self.owner = owner
        """The state that is left."""

    def on_enter(self, m: MachineState) -> None:
        """Called when the owner is entered."""

    def triggered(self, m: MachineState) -> bool:
        """Whether to fire; called once a tick, after the owner's tick."""
        raise NotImplementedError

    def why(self, m: MachineState) -> str:
        """The values that were compared, for the trace."""
        return self.spec.type

    def hand_over(self, m: MachineState) -> Sighting | None:
        """What the next state gets as its target."""
        return None


RUNTIMES: dict[str, type[Condition[Any]]] = {}
"""The class that runs each type of condition."""

R = TypeVar("R", bound=type[Condition[Any]])


def runs(spec: type[ConditionSpec]) -> Callable[[R], R]:
    """Class decorator: this class runs conditions of that spec, which machine files may name from now on."""

    def decorate(runtime: R) -> R:
        RUNTIMES[register(CONDITIONS, spec)] = runtime
        return runtime

    return decorate


def build(spec: ConditionSpec, owner: State[Any]) -> Condition[Any]:
    """The running condition of a spec."""
    return RUNTIMES[spec.type](spec, owner)


@runs(AlwaysSpec)
class Always(Condition[AlwaysSpec]):
    """Fires at once: in the tick in which its owner computed its first output."""

    counts = False

    def triggered(self, m: MachineState) -> bool:
        """Always."""
        return True


@runs(DistanceSpec)
class Distance(Condition[DistanceSpec]):
    """Fires after a hall distance."""

    counts = False

    def on_enter(self, m: MachineState) -> None:
        """Remember where it began."""
        self.entry = m.distance

    def triggered(self, m: MachineState) -> bool:
        """Driven far enough."""
        return m.distance - self.entry >= self.spec.distance

    def why(self, m: MachineState) -> str:
        """Driven and wanted."""
        return f"driven {m.distance - self.entry:.3f} >= {self.spec.distance:g} m"


@runs(TimerSpec)
class Timer(Condition[TimerSpec]):
    """Fires after a time."""

    counts = False

    def on_enter(self, m: MachineState) -> None:
        """Remember when it began."""
        self.entry = m.time

    def triggered(self, m: MachineState) -> bool:
        """Long enough; half a nanosecond of rounding is forgiven."""
        return m.time - self.entry >= self.spec.seconds - 5e-10

    def why(self, m: MachineState) -> str:
        """Time since entry and wanted."""
        return f"{m.time - self.entry:.3f} >= {self.spec.seconds:g} s"


@runs(TurnedSpec)
class Turned(Condition[TurnedSpec]):
    """Fires after a turn by dead reckoning."""

    counts = False

    def __init__(self, spec: TurnedSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.angle = math.radians(spec.angle_deg)

    def on_enter(self, m: MachineState) -> None:
        """Remember the heading."""
        self.entry = m.yaw

    def triggered(self, m: MachineState) -> bool:
        """Turned far enough, to either side."""
        return abs(m.yaw - self.entry) >= self.angle

    def why(self, m: MachineState) -> str:
        """Turned and wanted."""
        return f"turned {math.degrees(m.yaw - self.entry):+.1f}, {self.spec.angle_deg:g} deg wanted"


@runs(AlignedSpec)
class Aligned(Condition[AlignedSpec]):
    """Fires when the car points along or across the corridor."""

    counts = False

    def __init__(self, spec: AlignedSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.angle = math.radians(spec.angle_deg)

    def triggered(self, m: MachineState) -> bool:
        """Within the angle."""
        return abs(m.heading) <= self.angle

    def why(self, m: MachineState) -> str:
        """Heading and angle."""
        return f"heading {math.degrees(m.heading):+.1f} within {self.spec.angle_deg:g} deg"


@runs(FinishedSpec)
class Finished(Condition[FinishedSpec]):
    """Fires when its owner says that it is finished."""

    counts = False

    def triggered(self, m: MachineState) -> bool:
        """Ask the owner."""
        return bool(self.owner.finished)  # type: ignore[attr-defined]

    def why(self, m: MachineState) -> str:
        """Who is finished."""
        return f"{self.owner.spec.type} is finished"


@runs(UnreachableSpec)
class Unreachable(Condition[UnreachableSpec]):
    """Fires when its owner has said for long enough why it cannot come to its target."""

    def __init__(self, spec: UnreachableSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.counts = spec.seconds > 0.0

    def on_enter(self, m: MachineState) -> None:
        """It is within reach so far."""
        self.since = math.inf

    def triggered(self, m: MachineState) -> bool:
        """There has been a reason all the time."""
        self.since = min(self.since, m.time) if self.owner.unreachable(m) else math.inf
        return m.time - self.since >= self.spec.seconds - 5e-10

    def why(self, m: MachineState) -> str:
        """The reason."""
        return self.owner.unreachable(m) or "the target is within reach"


@runs(SensorLevelSpec)
class SensorLevel(Condition[SensorLevelSpec]):
    """Fires when an ultrasonic is above or below a level.

    The reading that stands at entry counts as the first one; later ones count when they are new.
    """

    def __init__(self, spec: SensorLevelSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.is_below = spec.below is not None
        self.level = spec.below if spec.below is not None else spec.above if spec.above is not None else math.nan
        self.agreed = 0
        self.fresh = True

    def on_enter(self, m: MachineState) -> None:
        """No reading has agreed yet."""
        self.agreed = 0
        self.fresh = True

    def triggered(self, m: MachineState) -> bool:
        """Count readings that agree, one after the other."""
        sonar = getattr(m, self.spec.sensor)
        if sonar.new or self.fresh:
            self.fresh = False
            agrees = sonar.range < self.level if self.is_below else sonar.range > self.level
            self.agreed = self.agreed + 1 if agrees else 0
        return self.agreed >= self.spec.readings

    def why(self, m: MachineState) -> str:
        """Range and level."""
        reading = getattr(m, self.spec.sensor).range
        return f"{self.spec.sensor} {reading:.3f} {'<' if self.is_below else '>'} {self.level:g} m"


class Composite(Condition[Any]):
    """Conditions combined. Those that count are asked in every tick, so that they miss no reading."""

    def __init__(self, spec: AllSpec | AnySpec | NotSpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.parts = [build(part, owner) for part in spec.of]
        self.counting = [(part, part.triggered) for part in self.parts if part.counts]
        self.others = [(part, part.triggered) for part in self.parts if not part.counts]
        self.counts = bool(self.counting)

    def on_enter(self, m: MachineState) -> None:
        """All parts start anew."""
        for part in self.parts:
            part.on_enter(m)

    def reasons(self, m: MachineState) -> list[Condition[Any]]:
        """The parts for which it fires; asked right after `triggered` said yes."""
        raise NotImplementedError

    def why(self, m: MachineState) -> str:
        """The values of the parts for which it fires."""
        return f"{self.spec.type}({'; '.join(part.why(m) for part in self.reasons(m))})"

    def hand_over(self, m: MachineState) -> Sighting | None:
        """What the first of the parts for which it fires hands over."""
        for part in self.reasons(m):
            target = part.hand_over(m)
            if target is not None:
                return target
        return None


@runs(AllSpec)
class All(Composite):
    """Fires when all parts hold."""

    def triggered(self, m: MachineState) -> bool:
        """All."""
        holds = True
        for _, ask in self.counting:
            holds = ask(m) and holds
        if holds:
            for _, ask in self.others:
                if not ask(m):
                    return False
        return holds

    def reasons(self, m: MachineState) -> list[Condition[Any]]:
        """All parts."""
        return self.parts


@runs(AnySpec)
class Any_(Composite):  # noqa: N801
    """Fires when one part holds."""

    def __init__(self, spec: AnySpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.held: list[Condition[Any]] = []
        """Counting parts that held when they were asked last."""

    def triggered(self, m: MachineState) -> bool:
        """Any."""
        if self.counting:
            self.held = [part for part, ask in self.counting if ask(m)]
            if self.held:
                return True
        for _, ask in self.others:  # noqa: SIM110 - any(...) would cost a generator in every tick
            if ask(m):
                return True
        return False

    def reasons(self, m: MachineState) -> list[Condition[Any]]:
        """The parts that hold, in their order."""
        held = {id(part) for part in self.held} | {id(part) for part, ask in self.others if ask(m)}
        return [part for part in self.parts if id(part) in held]


@runs(NotSpec)
class Not(Composite):
    """Fires when its part does not hold."""

    def triggered(self, m: MachineState) -> bool:
        """Not."""
        return not self.parts[0].triggered(m)

    def reasons(self, m: MachineState) -> list[Condition[Any]]:
        """The part that does not hold."""
        return self.parts

    def hand_over(self, m: MachineState) -> Sighting | None:
        """Nothing: what is not seen cannot be handed over."""
        return None
