"""The machines that come with the package, by name."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable

from tral_fsm.definition.machine import Load, MachineDefinition

_reader: Load


def _folder() -> Traversable:
    return files("tral_fsm").joinpath("machines")


@cache
def names() -> tuple[str, ...]:
    """Names of the packaged machines, sorted."""
    return tuple(sorted(entry.name[:-5] for entry in _folder().iterdir() if entry.name.endswith(".json")))


def text(name: str) -> str:
    """A packaged machine as TRAL JSON."""
    return _folder().joinpath(f"{name}.json").read_text("utf-8")


def read_with(reader: Load) -> None:
    """Let a function read packaged machines from now on.

    The front door `tral_fsm` hands over that of `tral_fsm.formats`, so that the engine loads no reader by itself.
    """
    global _reader
    _reader = reader


def load(name: str) -> MachineDefinition:
    """A packaged machine.

    Raises:
        MachineError: there is no packaged machine of that name.
    """
    return _reader(name)
