"""State machines that drive: definition, states, transitions, policy."""

from tral_fsm.conditions import detections as sightings
from tral_fsm.conditions import retry_limit as again
from tral_fsm.definition.checks import FormatError, Problem, check
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.estimation.estimator import MachineState
from tral_fsm.formats.library import load as load_machine
from tral_fsm.formats.library import names as machine_names
from tral_fsm.runtime.machine import Machine, Transit
from tral_fsm.runtime.policy import MachinePolicy, load_policy
from tral_fsm.states import corridor, scurve
from tral_fsm.states import wall as following

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
