"""What a machine is, as plain validated data: states, transitions and their parameters.

Every class of a state is one "type" of a machine file. Parameters are in physical units; `STATES` lists them all. What
makes a transition fire stands in `conditions`; how both run, in `states` and `transitions`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from pydantic import Field, SerializeAsAny

from tral_env.interface import NO_ECHO_M
from tral_fsm.definition.conditions import ConditionSpec
from tral_fsm.definition.validated import Id, Side, Spec, quantity, type_name


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


class WallSpec(DrivingSpec):
    """Base of the states that keep a clearance to a wall."""

    needs: ClassVar[Mapping[str, str]] = {"slow_front": "speed"}

    side: Side = Field("right", description="the wall that is followed")
    p: float = quantity(1.2, "1/m", "steering for a metre of deviation", ge=0.0, le=1000.0)
    i: float = quantity(0.0, "1/(m s)", "steering for a metre of deviation a second", ge=0.0, le=1000.0)
    d: float | None = quantity(
        1.5,
        "s/m",
        "steering for a deviation that grows by 1 m/s; null: what damps p by 0.707 at the speed that the car has",
        ge=0.0,
        le=1000.0,
    )
    derivative: Literal["sonar", "tick"] = Field(
        "sonar", description="over the sonar's own interval, or tick: the literal law of 2016"
    )
    max_error: float | None = quantity(0.4, "m", "e is clipped to this; null: not at all", gt=0.0, le=6.0)
    max_angle_deg: float | None = quantity(
        18.0,
        "deg",
        "e is clipped so that the wall is approached no steeper, or it gives no echo; null: not",
        gt=0.0,
        le=90.0,
    )
    max_rate: float = quantity(0.5, "m/s", "e' over the sonar's interval is clipped to this", gt=0.0, le=1000.0)
    reach: float = quantity(2.5, "m", "a range above it is no wall: the course is held", gt=0.0, le=NO_ECHO_M)
    at_most_half: bool = Field(
        False, description="the wanted clearance is never more than half of what both sides have together"
    )
    learn_trim: float = quantity(
        0.0, "1/(m s)", "kept for old files: the estimator learns the trim itself", ge=0.0, le=10.0
    )
    slow_front: float | None = quantity(None, "m", "front range from which on the car slows down", gt=0.0, le=5.0)
    slow_speed: float = quantity(0.3, "m/s", "speed at half of slow_front and nearer", ge=0.0, le=5.0)


def _clearance() -> Any:
    return quantity(0.8, "m", "wanted range of the side ultrasonic", gt=0.0, le=5.0)


class BasicFollowWallSpec(WallSpec):
    """Keeps a clearance to one wall: y = p e + i esum PID_S + d (e - eold) PID_INVS, e = range - clearance."""

    type: Literal["BasicFollowWall"] = "BasicFollowWall"
    clearance: float = _clearance()


class FollowWallSpec(WallSpec):
    """Wall following that ignores sudden changes of the range, so that door frames do not upset it."""

    type: Literal["FollowWall"] = "FollowWall"
    clearance: float = _clearance()
    ignore_jump: float = quantity(0.02, "m", "a larger change from one reading to the next is ignored", gt=0.0, le=6.0)


class FollowWallRampSpec(WallSpec):
    """Wall following whose clearance runs linearly with the distance driven, from `start` to `target`."""

    targetable: ClassVar[bool] = True

    type: Literal["FollowWallRamp"] = "FollowWallRamp"
    start: float | None = quantity(None, "m", "clearance at entry; null: the range then", gt=0.0, le=5.0)
    target: float = quantity(0.5, "m", "clearance at the end", gt=0.0, le=5.0)
    distance: float = quantity(1.5, "m", "hall distance in which it changes", gt=0.0, le=100.0)
    before: float = quantity(0.0, "m", "ends this far before a point that is handed over", ge=0.0, le=5.0)
    along_wall: bool = Field(
        False, description="turn a point that is handed over by the car's angle to the wall; false: as 2016 did, not"
    )

    @property
    def finishable(self) -> bool:
        """At the end of its distance."""
        return True


class ApproachPointSpec(DrivingSpec):
    """Drives to a point by dead reckoning; a gate that is handed over is approached along its axis."""

    targetable: ClassVar[bool] = True

    type: Literal["ApproachPoint"] = "ApproachPoint"
    x: float = quantity(1.0, "m", "point ahead of the car at entry, unless one is handed over", ge=-20.0, le=20.0)
    y: float = quantity(0.0, "m", "point left of the car at entry", ge=-20.0, le=20.0)
    heading_deg: float | None = quantity(
        None, "deg", "direction in which the point is passed, + = left; null: any", ge=-180.0, le=180.0
    )
    before: float = quantity(
        1.0, "m", "stops this far before a gate that is handed over; negative: behind it", ge=-5.0, le=5.0
    )
    tolerance: float = quantity(0.05, "m", "arrived within this distance along the way", gt=0.0, le=2.0)
    length: float = quantity(0.35, "m", "an offset from the axis dies away by e in it", gt=0.0, le=5.0)
    max_angle_deg: float = quantity(45.0, "deg", "the axis is approached no steeper", gt=0.0, le=90.0)
    aside: float = quantity(0.1, "m", "out of reach if the point would be missed by more", gt=0.0, le=2.0)
    track: bool = Field(True, description="take each new sighting of the gate that was handed over")

    @property
    def finishable(self) -> bool:
        """On arrival."""
        return True


class ArucoGateCenterSpec(DrivingSpec):
    """Full lock towards the side on which the gate's middle is, until the car is aligned with the gate's axis."""

    type: Literal["ArucoGateCenter"] = "ArucoGateCenter"
    tolerance_deg: float = quantity(4.0, "deg", "aligned within this angle", gt=0.0, le=45.0)
    lock: float = quantity(1.0, "", "share of full lock", gt=0.0, le=1.0)
    max_distance: float = quantity(1.5, "m", "gives up, and is finished, after this hall distance", gt=0.0, le=20.0)

    @property
    def finishable(self) -> bool:
        """When aligned."""
        return True


class MotorSpec(DrivingSpec):
    """Fixed steering and speed, for a distance or until a transition fires."""

    never_finishes_hint: ClassVar[str] = "a Motor needs a distance for that"

    type: Literal["Motor"] = "Motor"
    steering: float = quantity(0.0, "", "+1 = full left", ge=-1.0, le=1.0)
    distance: float | None = quantity(None, "m", "hall distance after which it is finished", gt=0.0, le=1000.0)

    @property
    def finishable(self) -> bool:
        """After its distance, if it has one."""
        return self.distance is not None


class StopSpec(StateSpec):
    """Stops the car: brakes while it rolls, then neutral."""

    type: Literal["Stop"] = "Stop"
    brake: float = quantity(0.3, "", "throttle against the direction in which the car rolls", ge=0.0, le=1.0)
    hold: float = quantity(
        0.0, "s", "brakes at least so long: a motor controller wants to see it before it reverses", ge=0.0, le=60.0
    )

    @property
    def may_end(self) -> bool:
        """A stopped car may stay."""
        return True


class IdleSpec(StateSpec):
    """Does nothing: the command stays at neutral."""

    type: Literal["Idle"] = "Idle"


class FSMStateSpec(StateSpec):
    """A whole machine as one state, inline or by the name of a packaged one. Its root takes what is handed over."""

    holds_machine: ClassVar[bool] = True
    never_finishes_hint: ClassVar[str] = "its machine has no state in which it may end"

    type: Literal["FSMState"] = "FSMState"
    machine: MachineDefinition | str = Field(description="the inner machine, or the name of a packaged one")

    @property
    def finishable(self) -> bool:
        """When its machine has come to its end, if it has one. Of a packaged one that is seen when it is loaded."""
        return isinstance(self.machine, str) or self.machine.may_end

    @property
    def takes_target(self) -> bool:
        """If the root of its machine does. Of a packaged one that is seen when it is loaded."""
        if isinstance(self.machine, str):
            return True
        root = self.machine.root
        return any(state.id == root and state.takes_target for state in self.machine.states)

    @property
    def inner(self) -> MachineDefinition | str:
        """Its machine."""
        return self.machine


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


FSMStateSpec.model_rebuild()


_STATES = (
    BasicFollowWallSpec, FollowWallSpec, FollowWallRampSpec, ApproachPointSpec, ArucoGateCenterSpec, MotorSpec,
    StopSpec, IdleSpec, FSMStateSpec,
)  # fmt: skip

STATES: dict[str, type[StateSpec]] = {type_name(spec): spec for spec in _STATES}
"""Every known type of state. `states.register` adds to it."""
