"""State machines that drive: definition, states, transitions, policy."""

from tral_fsm import again, corridor, following, scurve, sightings  # register their states and conditions
from tral_fsm.checks import FormatError, Problem, check
from tral_fsm.definition import MachineDefinition
from tral_fsm.library import load as load_machine
from tral_fsm.library import names as machine_names
from tral_fsm.machine import Machine, Transit
from tral_fsm.machine_state import MachineState
from tral_fsm.policy import MachinePolicy, load_policy

__all__ = [
    "FormatError",
    "Machine",
    "MachineDefinition",
    "MachinePolicy",
    "MachineState",
    "Problem",
    "Transit",
    "again",
    "check",
    "corridor",
    "following",
    "load_machine",
    "load_policy",
    "machine_names",
    "scurve",
    "sightings",
]
