"""State machines that drive: what a machine file says, how a machine runs, and how it is measured and tuned."""

from tral_fsm import starting as starting

# isort: split
from tral_fsm import conditions, states
from tral_fsm.conditions import Condition
from tral_fsm.control.command import Command
from tral_fsm.definition import packaged
from tral_fsm.definition.checks import FormatError, Problem, check
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.estimation.estimate import CarEstimate
from tral_fsm.formats.library import by_name
from tral_fsm.formats.library import load as load_machine
from tral_fsm.formats.library import names as machine_names
from tral_fsm.policies import load_policy
from tral_fsm.runtime.driver import Driver
from tral_fsm.runtime.machine import Machine, Transit
from tral_fsm.runtime.policy import MachinePolicy
from tral_fsm.states import State

states.STATES.register_all(states.BUILT_IN)
conditions.CONDITIONS.register_all(conditions.BUILT_IN)
packaged.read_with(by_name)

__all__ = [
    "CarEstimate",
    "Command",
    "Condition",
    "Driver",
    "FormatError",
    "Machine",
    "MachineDefinition",
    "MachinePolicy",
    "Problem",
    "State",
    "Transit",
    "check",
    "conditions",
    "load_machine",
    "load_policy",
    "machine_names",
    "states",
]
