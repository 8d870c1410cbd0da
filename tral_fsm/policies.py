"""Policies by the name or the path of what drives."""

from __future__ import annotations

from pathlib import Path

from tral_fsm.formats import library
from tral_fsm.runtime.machine import Trace
from tral_fsm.runtime.policy import MachinePolicy


def load_policy(name_or_path: str | Path, trace: Trace | None = None) -> MachinePolicy:
    """The policy of a machine.

    Args:
        name_or_path: name of a packaged machine, or path of a file.
        trace: called for each transition that fires in the first car.

    Returns:
        A policy for one car; `reset(n)` for more.

    Raises:
        MachineError: no such machine, or it cannot run.
    """
    return MachinePolicy(library.load(name_or_path), trace)
