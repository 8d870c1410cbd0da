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
    """Base of the specs of conditions that combine others."""

    of: tuple[SerializeAsAny[ConditionSpec], ...] = Field(description="the conditions that are combined", min_length=1)

    @property
    def parts(self) -> tuple[ConditionSpec, ...]:
        """The conditions in `of`."""
        return self.of

    @property
    def hands_over(self) -> bool:
        """Whether one of the parts hands a gate over."""
        return any(part.hands_over for part in self.of)


C = TypeVar("C", bound=CombinedSpec)


class Combination(Condition[C]):
    """Combined conditions. Parts that count are asked in every tick, so that they miss no reading."""

    def __init__(self, spec: C, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.parts = [build(part, owner) for part in spec.of]
        self._sort()

    def _sort(self) -> None:
        self.counting = [(part, part.triggered) for part in self.parts if part.counts]
        self.others = [(part, part.triggered) for part in self.parts if not part.counts]
        self.counts = bool(self.counting)

    def retune(self, spec: C) -> None:
        """All parts go on with other parameters."""
        for part, its in zip(self.parts, spec.of, strict=True):
            part.retune(its)
        self.spec = spec
        self._sort()

    def on_enter(self, estimate: CarEstimate) -> None:
        """All parts start again."""
        for part in self.parts:
            part.on_enter(estimate)

    def restart(self) -> None:
        """All parts forget everything."""
        for part in self.parts:
            part.restart()

    def reasons(self, estimate: CarEstimate) -> list[Condition[Any]]:
        """The parts that decide in this tick. It is asked right after `triggered`."""
        raise NotImplementedError

    def why(self, estimate: CarEstimate) -> str:
        """The compared values of the parts that decide."""
        return f"{self.spec.type}({'; '.join(part.why(estimate) for part in self.reasons(estimate))})"

    def hand_over(self, estimate: CarEstimate) -> Detection | None:
        """The gate of the first part that decides and hands one over."""
        for part in self.reasons(estimate):
            target = part.hand_over(estimate)
            if target is not None:
                return target
        return None


class AllSpec(CombinedSpec):
    """Fires when all of its conditions hold in the same tick."""

    joined: ClassVar[tuple[str, str]] = ("", " and ")

    type: Literal["All"] = "All"

    @property
    def holds_always(self) -> bool:
        """Whether each part always holds."""
        return all(part.holds_always for part in self.of)

    @property
    def holds_never(self) -> bool:
        """Whether one part never holds."""
        return any(part.holds_never for part in self.of)


class All(Combination[AllSpec]):
    """Fires when all parts hold."""

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether all parts hold."""
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

    joined: ClassVar[tuple[str, str]] = ("", " or ")

    type: Literal["Any"] = "Any"

    @property
    def holds_always(self) -> bool:
        """Whether one part always holds."""
        return any(part.holds_always for part in self.of)

    @property
    def holds_never(self) -> bool:
        """Whether all parts never hold."""
        return all(part.holds_never for part in self.of)


class AnyOf(Combination[AnySpec]):
    """Fires when one part holds."""

    def __init__(self, spec: AnySpec, owner: State[Any]) -> None:
        super().__init__(spec, owner)
        self.held: list[Condition[Any]] = []
        """Counting parts that held in this tick."""

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether a part holds."""
        if self.counting:
            self.held = [part for part, ask in self.counting if ask(estimate)]
            if self.held:
                return True
        for _, ask in self.others:  # noqa: SIM110 - any(...) would cost a generator in every tick
            if ask(estimate):
                return True
        return False

    def reasons(self, estimate: CarEstimate) -> list[Condition[Any]]:
        """The parts that hold, in the order of the file; all parts if none holds, as within a Not that fires."""
        held = {id(part) for part in self.held} | {id(part) for part, ask in self.others if ask(estimate)}
        return [part for part in self.parts if id(part) in held] or self.parts


class NotSpec(CombinedSpec):
    """Fires when its one condition does not hold."""

    joined: ClassVar[tuple[str, str]] = ("not ", "")

    type: Literal["Not"] = "Not"
    of: tuple[SerializeAsAny[ConditionSpec], ...] = Field(
        description="one condition, in an array", min_length=1, max_length=1
    )

    @property
    def hands_over(self) -> bool:
        """Nothing is handed over: the gate is not seen."""
        return False

    @property
    def holds_always(self) -> bool:
        """Whether the part never holds."""
        return self.of[0].holds_never

    @property
    def holds_never(self) -> bool:
        """Whether the part always holds."""
        return self.of[0].holds_always


class Not(Combination[NotSpec]):
    """Fires when its part does not hold."""

    def triggered(self, estimate: CarEstimate) -> bool:
        """Whether the part does not hold."""
        return not self.parts[0].triggered(estimate)

    def reasons(self, estimate: CarEstimate) -> list[Condition[Any]]:
        """The part that does not hold."""
        return self.parts

    def hand_over(self, estimate: CarEstimate) -> Detection | None:
        """Nothing is handed over: the gate is not seen."""
        return None
