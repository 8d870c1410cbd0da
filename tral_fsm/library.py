"""Where machines come from: packaged ones by name, others by path."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from tral_env.errors import MachineError, nearest
from tral_fsm.checks import FormatError, Problem
from tral_fsm.definition import FSMStateSpec, MachineDefinition
from tral_fsm.formats import tral_json

SUFFIXES = (".json",)
"""Files that can be read."""


def names() -> list[str]:
    """Names of the packaged machines."""
    return sorted(
        entry.name[:-5] for entry in files("tral_fsm").joinpath("machines").iterdir() if entry.name.endswith(".json")
    )


def load(name_or_path: str | Path) -> MachineDefinition:
    """Read a machine.

    Args:
        name_or_path: name of a packaged machine, or path of a file.

    Returns:
        The checked definition.

    Raises:
        MachineError: no such machine or file, or a kind of file that cannot be read.
        FormatError: the file is not a machine that can run; all its problems.
    """
    definition = _read(name_or_path)
    _refuse_cycles(definition, (str(name_or_path),))
    return definition


def _read(name_or_path: str | Path) -> MachineDefinition:
    text = str(name_or_path)
    if text in names():
        return tral_json.loads(
            files("tral_fsm").joinpath("machines", f"{text}.json").read_text("utf-8"), f"{text}.json"
        )
    path = Path(name_or_path)
    if path.suffix not in SUFFIXES:
        raise MachineError(f"'{text}' is no packaged machine and no {SUFFIXES[0]} file: {nearest(text, names())}")
    try:
        content = path.read_text("utf-8")
    except OSError as error:
        raise MachineError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise MachineError(f"{path}: not UTF-8 text: {error.reason} at byte {error.start}") from error
    return tral_json.loads(content, str(path))


def _refuse_cycles(definition: MachineDefinition, around: tuple[str, ...]) -> None:
    """A packaged machine must not hold itself, however deep."""
    for index, state in enumerate(definition.states):
        if not isinstance(state, FSMStateSpec):
            continue
        inner = state.machine
        if isinstance(inner, MachineDefinition):
            _refuse_cycles(inner, around)
            continue
        at = f"/states/{index}/machine"
        if inner not in names():
            raise FormatError(around[-1], [Problem(at, f"got {inner!r}: {nearest(inner, names())}")])
        if inner in around:
            raise FormatError(around[-1], [Problem(at, f"holds itself: {' > '.join((*around, inner))}")])
        _refuse_cycles(_read(inner), (*around, inner))
