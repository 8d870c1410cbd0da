"""Where machines come from: packaged ones by name, others by path."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from tral_env.errors import MachineError, nearest
from tral_fsm import formats
from tral_fsm.checks import FormatError, check_inner
from tral_fsm.definition import MachineDefinition
from tral_fsm.formats import FORMATS, read_file, tral_json
from tral_fsm.formats.plain import located

SUFFIXES = tuple(dict.fromkeys(suffix for entry in FORMATS.values() if entry.reads for suffix in entry.suffixes))
"""Files that can be read."""


def names() -> list[str]:
    """Names of the packaged machines."""
    return sorted(
        entry.name[:-5] for entry in files("tral_fsm").joinpath("machines").iterdir() if entry.name.endswith(".json")
    )


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
    definition = _read(name_or_path)
    problems = check_inner(definition, names(), _read, (str(name_or_path),))
    if problems:
        places = {} if str(name_or_path) in names() else formats.places(Path(name_or_path))
        raise FormatError(str(name_or_path), [located(problem, places) for problem in problems])
    return definition


def _read(name_or_path: str | Path) -> MachineDefinition:
    text = str(name_or_path)
    if text in names():
        return tral_json.loads(
            files("tral_fsm").joinpath("machines", f"{text}.json").read_text("utf-8"), f"{text}.json"
        )
    path = Path(name_or_path)
    if path.suffix.lower() not in SUFFIXES and not path.is_file():
        kinds = ", ".join(SUFFIXES)
        raise MachineError(f"'{text}' is no packaged machine and no file ({kinds}): {nearest(text, names())}")
    return read_file(path)
