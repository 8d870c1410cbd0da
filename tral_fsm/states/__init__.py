"""The states that a machine file may name: the spec of each type, and the class that runs it."""

from tral_fsm.definition.machine import STATES
from tral_fsm.states.approach_point import ApproachPoint
from tral_fsm.states.base import DrivingState, State, register
from tral_fsm.states.basic import Idle, Motor, Stop
from tral_fsm.states.corridor import BackUp, FollowCorridor, Turn
from tral_fsm.states.fsm_state import FSMState
from tral_fsm.states.gate_center import ArucoGateCenter
from tral_fsm.states.scurve import SCurve
from tral_fsm.states.wall import BasicFollowWall, FollowWall, FollowWallRamp

BUILT_IN = (
    BasicFollowWall, FollowWall, FollowWallRamp, ApproachPoint, ArucoGateCenter, Motor, Stop, Idle, FSMState,
    FollowCorridor, Turn, BackUp, SCurve,
)  # fmt: skip
"""The states of the package, in the order of the schema and of all lists."""

__all__ = ["BUILT_IN", "STATES", "DrivingState", "State", "register"]
