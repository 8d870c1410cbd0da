"""Machines by name, if they are packaged, else by path."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from tral_env.errors import MachineError, nearest
from tral_fsm.definition import packaged
from tral_fsm.definition.checks import FormatError, check
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.formats import FORMATS, read_file, tral_json
from tral_fsm.formats.plain import located

SUFFIXES = tuple(dict.fromkeys(suffix for entry in FORMATS.values() if entry.reads for suffix in entry.suffixes))
"""Suffixes of files that can be read."""


def names() -> list[str]:
    """Names of the packaged machines."""
    return list(packaged.names())


def load(name_or_path: str | Path, other_names: Sequence[str] = ()) -> MachineDefinition:
    """Read a machine.

    Args:
        name_or_path: name of a packaged machine, or path of a file in any readable format: TRAL JSON, a UMLet
            diagram (.uxf) or its xml2json form, SCXML. The content decides, else the suffix.
        other_names: trained policies that the caller knows by name, for the error; empty: it takes machines alone.

    Returns:
        The checked definition.

    Raises:
        MachineError: there is no such machine, or the file cannot be opened.
        FormatError: the file is no machine that can run; the error lists all problems.
    """
    return load_with_notes(name_or_path, other_names)[0]


def load_with_notes(
    name_or_path: str | Path, other_names: Sequence[str] = ()
) -> tuple[MachineDefinition, tuple[str, ...]]:
    """Read a machine as `load` does, and tell what in its file was read and does nothing."""
    name = str(name_or_path)
    if name in packaged.names():
        definition = by_name(name)
        problems = check(definition, by_name, (name,))
        if problems:
            raise FormatError(name, problems)
        return definition, ()
    path = Path(name_or_path)
    if path.suffix.lower() not in SUFFIXES and not _may_be_read(path):
        kinds = ", ".join(SUFFIXES)
        if other_names:
            what = f"no packaged machine, no file ({kinds}), and no folder with the policy.json of a training"
        else:
            what = f"no packaged machine, and no file of one ({kinds})"
        raise MachineError(f"{name[:80]!r} is {what}: {nearest(name, [*names(), *other_names])}")
    definition, places, notes = read_file(path)
    problems = check(definition, by_name)
    if problems:
        raise FormatError(name, [located(problem, places) for problem in problems])
    return definition, notes


@cache
def by_name(name: str) -> MachineDefinition:
    """A packaged machine, which is read once even if many cars drive it.

    Raises:
        MachineError: there is no packaged machine of that name.
    """
    if name not in packaged.names():
        raise MachineError(f"{name[:80]!r} is no packaged machine: {nearest(name, names())}")
    return tral_json.loads(packaged.text(name), f"{name}.json")


def _may_be_read(path: Path) -> bool:
    """Whether the path is a file or a pipe."""
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):  # too long a name, or one with a null
        return False
