"""The files of a policy, which a recording keeps so that the drive can be repeated; this loads no simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tral_env import policy_file
from tral_fsm.evaluation.own_policy import files_of
from tral_fsm.formats import write
from tral_fsm.policies import trained
from tral_fsm.runtime.policy import MachinePolicy

MACHINE = "machine.json"
"""A recording keeps the machine that drove under this name."""


def files_of_policy(source: str, policy: Any) -> dict[str, bytes]:
    """The files of a policy, for a recording to keep.

    Args:
        source: as on the command line: the name of a machine or of a packaged policy, a path, or FILE.py:NAME.
        policy: the policy.
    """
    if isinstance(policy, MachinePolicy):
        return {MACHINE: write(policy.definition, "json").encode()}
    code, python, _ = source.partition(".py:")
    if python:
        return {path.name: path.read_bytes() for path in files_of(Path(f"{code}.py"))}
    path = Path(trained.path_of(source))
    folder = path if path.is_dir() else path.parent
    names = (policy_file.JSON_NAME, policy_file.WEIGHTS_NAME)
    return {name: (folder / name).read_bytes() for name in names if (folder / name).is_file()}
