"""Where machines come from: packaged ones by name, others by path."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from tral_env.errors import MachineError, nearest
from tral_fsm import formats
from tral_fsm.definition import checks, packaged
from tral_fsm.definition.checks import FormatError, Problem
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.formats import FORMATS, read_file, tral_json
from tral_fsm.formats.plain import located

SUFFIXES = tuple(dict.fromkeys(suffix for entry in FORMATS.values() if entry.reads for suffix in entry.suffixes))
"""Files that can be read."""


def names() -> list[str]:
    """Names of the packaged machines."""
    return list(packaged.names())


def load(name_or_path: str | Path) -> MachineDefinition:
    """Read a machine.

    Args:
        name_or_path: name of a packaged machine, or path of a file in any format that is read: TRAL JSON, a UMLet
            diagram (.uxf) or its xml2json form, SCXML. Its content decides, its suffix where that does not.

    Returns:
        The checked definition.

    Raises:
        MachineError: no such machine, or a file that cannot be opened.
        FormatError: the file is not a machine that can run; all its problems.
    """
    name = str(name_or_path)
    if name in packaged.names():
        definition = by_name(name)
        problems = check_inner(definition, (name,))
        if problems:
            raise FormatError(name, problems)
        return definition
    path = Path(name_or_path)
    if path.suffix.lower() not in SUFFIXES and not _may_be_read(path):
        kinds = ", ".join(SUFFIXES)
        raise MachineError(f"{name[:80]!r} is no packaged machine and no file ({kinds}): {nearest(name, names())}")
    definition = read_file(path)
    problems = check_inner(definition)
    if problems:
        places = formats.places(path)
        raise FormatError(name, [located(problem, places) for problem in problems])
    return definition


@cache
def by_name(name: str) -> MachineDefinition:
    """A packaged machine, read once however many cars drive it.

    Raises:
        MachineError: there is none of that name. What stands in a folder is none.
    """
    if name not in packaged.names():
        raise MachineError(f"{name[:80]!r} is no packaged machine: {nearest(name, names())}")
    return tral_json.loads(packaged.text(name), f"{name}.json")


def check_inner(machine: MachineDefinition, around: tuple[str, ...] = ()) -> list[Problem]:
    """All faults of the packaged machines that are named inside a machine, and of what leads to and from them.

    Args:
        machine: the outer one.
        around: names of the machines around, the outermost first.
    """
    return checks.check_inner(machine, names(), by_name, around)


def _may_be_read(path: Path) -> bool:
    """Something is there that is no folder: a file, or a pipe."""
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):  # too long a name, or one with a null
        return False
