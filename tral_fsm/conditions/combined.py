"""Conditions that combine others."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, TypeVar

from pydantic import Field, SerializeAsAny

from tral_fsm.conditions.base import Condition, build
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.estimation.detections import Detection
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.states.base import State


class CombinedSpec(ConditionSpec):
    """Base of the conditions that are made of others."""

    of: tuple[SerializeAsAny[ConditionSpec], ...] = Field(description="conditions", min_length=1)

    @property
    def parts(self) -> tuple[ConditionSpec, ...]:
        """Those in `of`."""
        return self.of

    @property
    def hands_over(self) -> bool:
        """Whether one of its parts hands a gate over."""
        return any(part.hands_over for part in self.of)


C = TypeVar("C", bound=CombinedSpec)


class Combination(Condition[C]):
    """Conditions combined. Those that count are asked in every tick, so that they miss no reading."""

    def __init__(self, spec: C, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.parts = [build(part, owner) for part in spec.of]
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


class AllSpec(CombinedSpec):
    """Fires when all of its conditions hold in the same tick."""

    word_between: ClassVar[str] = " and "

    type: Literal["All"] = "All"

    def always(self) -> bool:
        """When each part always holds."""
        return all(part.always() for part in self.of)

    def never(self) -> bool:
        """When one part never holds."""
        return any(part.never() for part in self.of)


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


class AnySpec(CombinedSpec):
    """Fires when one of its conditions holds."""

    word_between: ClassVar[str] = " or "

    type: Literal["Any"] = "Any"

    def always(self) -> bool:
        """When one part always holds."""
        return any(part.always() for part in self.of)

    def never(self) -> bool:
        """When no part ever holds."""
        return all(part.never() for part in self.of)


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


class NotSpec(CombinedSpec):
    """Fires when its one condition does not hold."""

    word_before: ClassVar[str] = "not "

    type: Literal["Not"] = "Not"
    of: tuple[SerializeAsAny[ConditionSpec], ...] = Field(description="one condition", min_length=1, max_length=1)

    @property
    def hands_over(self) -> bool:
        """A gate that is not seen cannot be handed over."""
        return False

    def always(self) -> bool:
        """When its part never holds."""
        return self.of[0].never()

    def never(self) -> bool:
        """When its part always holds."""
        return self.of[0].always()


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
