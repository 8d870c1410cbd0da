"""What makes a transition fire, as plain validated data: conditions and their parameters.

Every class here is one "type" of a machine file; `CONDITIONS` lists them all. How they run stands in `transitions`.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, SerializeAsAny

from tral_env.interface import NO_ECHO_M
from tral_fsm.definition.validated import MarkerId, SonarName, Spec, quantity, required, type_name


class ConditionSpec(Spec):
    """Base of what makes a transition fire. A condition of your own derives from it and names itself in `type`."""

    asks_owner_finished: ClassVar[bool] = False
    """The state that is left must be one that can say that it is finished."""
    asks_owner_target: ClassVar[bool] = False
    """The state that is left must be one that takes a target."""

    type: str

    @property
    def parts(self) -> tuple[ConditionSpec, ...]:
        """The conditions that this one combines."""
        return ()

    @property
    def hands_over(self) -> bool:
        """Whether a gate may be handed to the next state when this fires."""
        return False

    def always(self) -> bool:
        """Whether it holds in every tick, whatever the car reads."""
        return False

    def never(self) -> bool:
        """Whether it holds in no tick, whatever the car reads."""
        return False


class AlwaysSpec(ConditionSpec):
    """Fires at once."""

    type: Literal["Always"] = "Always"

    def always(self) -> bool:
        """In every tick."""
        return True


class DistanceSpec(ConditionSpec):
    """Fires after a hall distance in the state."""

    type: Literal["Distance"] = "Distance"
    distance: float = required("m", "driven since entry", ge=0.0, le=10000.0)

    def always(self) -> bool:
        """With no distance to drive."""
        return self.distance == 0.0


class TimerSpec(ConditionSpec):
    """Fires after a time in the state."""

    type: Literal["Timer"] = "Timer"
    seconds: float = required("s", "since entry", ge=0.0, le=100000.0)

    def always(self) -> bool:
        """With no time to wait."""
        return self.seconds == 0.0


class TurnedSpec(ConditionSpec):
    """Fires when the car has turned by an angle in the state, by dead reckoning, to either side."""

    type: Literal["Turned"] = "Turned"
    angle_deg: float = required("deg", "turned since entry", gt=0.0, le=3600.0)


class AlignedSpec(ConditionSpec):
    """Fires when the car points along or across the corridor, as wall following has learnt its direction.

    Beyond about 22 degrees a wall gives no echo, and cannot be told from an opening.
    """

    type: Literal["Aligned"] = "Aligned"
    angle_deg: float = quantity(12.0, "deg", "within this angle", gt=0.0, le=45.0)


class FinishedSpec(ConditionSpec):
    """Fires when the state says that it is finished."""

    asks_owner_finished: ClassVar[bool] = True

    type: Literal["Finished"] = "Finished"


class UnreachableSpec(ConditionSpec):
    """Fires when the state cannot come to its target any more: it lies behind, or needs too tight a turn."""

    asks_owner_target: ClassVar[bool] = True

    type: Literal["Unreachable"] = "Unreachable"
    seconds: float = quantity(
        0.0, "s", "it has been out of reach so long without a break: one bad sighting is none", ge=0.0, le=60.0
    )


class SensorLevelSpec(ConditionSpec):
    """Fires when an ultrasonic reads above or below a level. No echo counts as above."""

    exactly_one: ClassVar[tuple[str, ...]] = ("above", "below")

    type: Literal["SensorLevel"] = "SensorLevel"
    sensor: SonarName = Field("front", description="which ultrasonic")
    above: float | None = quantity(None, "m", "fires when the range is above", ge=0.0, lt=NO_ECHO_M)
    below: float | None = quantity(None, "m", "fires when the range is below", gt=0.0, le=NO_ECHO_M)
    readings: int = Field(1, description="so many readings must agree, one after the other", ge=1, le=100)


class SightingSpec(ConditionSpec):
    """Base of what fires when something is seen."""

    ids: tuple[MarkerId, ...] = Field((), description="only these ids; empty: any", strict=False)
    max_age: float = quantity(0.25, "s", "the sighting is not older", gt=0.0, le=10.0)
    max_distance: float = quantity(6.0, "m", "it is not farther away", gt=0.0, le=20.0)
    max_ahead: float = quantity(20.0, "m", "it is not farther ahead, by dead reckoning", gt=0.0, le=20.0)
    max_bearing_deg: float = quantity(90.0, "deg", "it is not farther to the side", gt=0.0, le=90.0)


class ArucoGateFoundSpec(SightingSpec):
    """Fires when a gate is seen ahead, and hands its position to the next state."""

    type: Literal["ArucoGateFound"] = "ArucoGateFound"
    hand_over: bool = Field(True, description="the next state must be targetable and takes the gate as its target")
    narrower_than: float | None = quantity(
        None, "m", "only a gate whose opening, as far as it has been seen, is narrower", gt=0.0, le=5.0
    )
    missed_by: float | None = quantity(
        None,
        "m",
        "only if the way straight on misses its middle by more, or, its opening known, does not lead through it",
        ge=0.0,
        le=5.0,
    )
    one_post: bool = Field(
        False, description="also fires when only one of its markers was ever seen: the middle is guessed beside it"
    )
    target: bool = Field(
        False, description="asks of the gate that was handed over last, whole or not, though another one be nearer"
    )

    @property
    def hands_over(self) -> bool:
        """As the file says."""
        return self.hand_over


class MarkerFoundSpec(SightingSpec):
    """Fires when a single marker is seen ahead."""

    type: Literal["MarkerFound"] = "MarkerFound"


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


class AllSpec(CombinedSpec):
    """Fires when all of its conditions hold in the same tick."""

    type: Literal["All"] = "All"

    def always(self) -> bool:
        """When each part always holds."""
        return all(part.always() for part in self.of)

    def never(self) -> bool:
        """When one part never holds."""
        return any(part.never() for part in self.of)


class AnySpec(CombinedSpec):
    """Fires when one of its conditions holds."""

    type: Literal["Any"] = "Any"

    def always(self) -> bool:
        """When one part always holds."""
        return any(part.always() for part in self.of)

    def never(self) -> bool:
        """When no part ever holds."""
        return all(part.never() for part in self.of)


class NotSpec(CombinedSpec):
    """Fires when its one condition does not hold."""

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


_CONDITIONS = (
    AlwaysSpec, DistanceSpec, FinishedSpec, UnreachableSpec, SensorLevelSpec, ArucoGateFoundSpec, TimerSpec, TurnedSpec,
    AlignedSpec, MarkerFoundSpec, AllSpec, AnySpec, NotSpec,
)  # fmt: skip

CONDITIONS: dict[str, type[ConditionSpec]] = {type_name(spec): spec for spec in _CONDITIONS}
"""Every known type of condition. `conditions.register` adds to it."""
