"""The conditions that a machine file may name: the spec of each type, and the class that runs it."""

from tral_fsm.conditions.base import Condition, register
from tral_fsm.conditions.combined import All, AnyOf, Not
from tral_fsm.conditions.gates import ArucoGateFound, MarkerFound
from tral_fsm.conditions.retry_limit import RetryLimit
from tral_fsm.conditions.simple import (
    Aligned,
    Always,
    Distance,
    Finished,
    SensorLevel,
    Timer,
    Turned,
    Unreachable,
)
from tral_fsm.conditions.walls import MoreRoom, ObstacleAhead, Opening
from tral_fsm.definition.conditions import CONDITIONS

BUILT_IN = (
    Always, Distance, Finished, Unreachable, SensorLevel, ArucoGateFound, Timer, Turned, Aligned, MarkerFound, All,
    AnyOf, Not, RetryLimit, Opening, ObstacleAhead, MoreRoom,
)  # fmt: skip
"""The conditions of the package, in the order of the schema and of all lists."""

__all__ = ["BUILT_IN", "CONDITIONS", "Condition", "register"]
