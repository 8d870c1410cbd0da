"""Any policy by its name or path: a machine, a trained network, a machine that a network corrects."""

from __future__ import annotations

from pathlib import Path

from tral_env import policy_file
from tral_env.errors import ConfigError, PolicyFileError
from tral_env.learned import LearnedPolicy
from tral_fsm.formats import library
from tral_fsm.policies import trained
from tral_fsm.policies.corrected import CorrectedPolicy
from tral_fsm.policies.of_network import policy_of
from tral_fsm.runtime.machine import Trace
from tral_fsm.runtime.policy import MachinePolicy


def load_policy(
    name_or_path: str | Path, trace: Trace | None = None
) -> MachinePolicy | LearnedPolicy | CorrectedPolicy:
    """A policy: a machine, or a trained network.

    Args:
        name_or_path: name of a packaged machine or of a packaged policy that was trained (`trained.names`), path of a
            machine's file, or path of a policy that was trained (its folder, or the policy.json in it).
        trace: called for each transition that fires in the first car of a machine.

    Returns:
        A policy for one car; `reset(n)` for more.

    Raises:
        MachineError: no such machine, or it cannot run.
        PolicyFileError: the policy was made for other readings, or its files are damaged.
    """
    path = trained.path_of(name_or_path)
    if policy_file.is_policy_file(path):
        try:
            return policy_of(policy_file.load_network(path))
        except ConfigError as error:
            raise PolicyFileError(f"{path}: {error}") from error
    return MachinePolicy(library.load(name_or_path, trained.names()), trace)


def load_machine_policy(name_or_path: str | Path, trace: Trace | None = None) -> MachinePolicy:
    """The policy of a machine, see `load_policy`.

    Raises:
        MachineError: no such machine, or it cannot run.
    """
    return MachinePolicy(library.load(name_or_path), trace)
