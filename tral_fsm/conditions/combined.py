"""Conditions that combine others."""

from __future__ import annotations

from typing import Any

from tral_fsm.conditions.base import C, Condition, build
from tral_fsm.definition.conditions import AllSpec, AnySpec, NotSpec
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import State


class Combination(Condition[C]):
    """Conditions combined. Those that count are asked in every tick, so that they miss no reading."""

    def __init__(self, spec: C, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.parts = [build(part, owner) for part in spec.of]  # type: ignore[attr-defined]
        self.counting = [(part, part.triggered) for part in self.parts if part.counts]
        self.others = [(part, part.triggered) for part in self.parts if not part.counts]
        self.counts = bool(self.counting)

    def on_enter(self, estimate: CarEstimate) -> None:
        """All parts start anew."""
        for part in self.parts:
            part.on_enter(estimate)

    def restart(self) -> None:
        """All parts forget."""
        for part in self.parts:
            part.restart()

    def reasons(self, estimate: CarEstimate) -> list[Condition[Any]]:
        """The parts for which it fires; asked right after `triggered` said yes."""
        raise NotImplementedError

    def why(self, estimate: CarEstimate) -> str:
        """The values of the parts for which it fires."""
        return f"{self.spec.type}({'; '.join(part.why(estimate) for part in self.reasons(estimate))})"

    def hand_over(self, estimate: CarEstimate) -> Detection | None:
        """What the first of the parts for which it fires hands over."""
        for part in self.reasons(estimate):
            target = part.hand_over(estimate)
            if target is not None:
                return target
        return None


class All(Combination[AllSpec]):
    """Fires when all parts hold."""

    def triggered(self, estimate: CarEstimate) -> bool:
        """All."""
        holds = True
        for _, ask in self.counting:
            holds = ask(estimate) and holds
        if holds:
            for _, ask in self.others:
                if not ask(estimate):
                    return False
        return holds

    def reasons(self, estimate: CarEstimate) -> list[Condition[Any]]:
        """All parts."""
        return self.parts


class AnyOf(Combination[AnySpec]):
    """Fires when one part holds."""

    def __init__(self, spec: AnySpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.held: list[Condition[Any]] = []
        """Counting parts that held when they were asked last."""

    def triggered(self, estimate: CarEstimate) -> bool:
        """Any."""
        if self.counting:
            self.held = [part for part, ask in self.counting if ask(estimate)]
            if self.held:
                return True
        for _, ask in self.others:  # noqa: SIM110 - any(...) would cost a generator in every tick
            if ask(estimate):
                return True
        return False

    def reasons(self, estimate: CarEstimate) -> list[Condition[Any]]:
        """The parts that hold, in their order."""
        held = {id(part) for part in self.held} | {id(part) for part, ask in self.others if ask(estimate)}
        return [part for part in self.parts if id(part) in held]


class Not(Combination[NotSpec]):
    """Fires when its part does not hold."""

    def triggered(self, estimate: CarEstimate) -> bool:
        """Not."""
        return not self.parts[0].triggered(estimate)

    def reasons(self, estimate: CarEstimate) -> list[Condition[Any]]:
        """The part that does not hold."""
        return self.parts

    def hand_over(self, estimate: CarEstimate) -> Detection | None:
        """Nothing: what is not seen cannot be handed over."""
        return None
