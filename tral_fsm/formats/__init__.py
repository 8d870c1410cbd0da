"""Text to definition and back, with a module for each format.

Each format becomes the same plain values and a map of places, which one reader validates. So all formats report
problems alike and give the same definition.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from tral_env.errors import MachineError, nearest
from tral_fsm.definition.checks import FormatError, Problem
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.formats.detect import decoded, parsed
from tral_fsm.formats.known import FORMATS, Format
from tral_fsm.formats.plain import EnoughProblemsError, Plain, Problems
from tral_fsm.formats.reader import definition, told
from tral_fsm.formats.xml_tree import XMLError

__all__ = ["FORMATS", "MAX_BYTES", "Content", "Format", "by_suffix", "read", "read_file", "write"]

MAX_BYTES = 2 * 1024 * 1024
"""Largest size of a file. Source: choice; the largest reference machine has 13,000 bytes."""


class Content(NamedTuple):
    """What a machine file holds."""

    definition: MachineDefinition
    places: Mapping[str, str]
    """Places in the file as words, by JSON pointer; none for TRAL JSON."""
    notes: tuple[str, ...]
    """What was read and does nothing."""


def read(content: str | bytes, source: str, suffix: str = "") -> MachineDefinition:
    """Read a machine in any readable format.

    Args:
        content: the whole file; bytes are UTF-8, unless a byte order mark or an XML declaration says otherwise.
        source: name of the file, for messages.
        suffix: suffix of the file; it decides where the content does not.

    Returns:
        The definition.

    Raises:
        FormatError: the content is no machine that can run; the error lists all problems.
    """
    return _read(content, source, suffix).definition


def _read(content: str | bytes, source: str, suffix: str) -> Content:
    problems = Problems()
    plain = Plain()
    try:
        text = content if isinstance(content, str) else decoded(content)
        size = len(content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content)
        if size > MAX_BYTES:
            raise XMLError(f"got {size} bytes, at most {MAX_BYTES} are read")
        name, values = parsed(text, suffix, problems)
        reads = FORMATS[name].reads
        assert reads is not None, "a format that is detected can be read"
        plain = reads(values, problems)
    except MachineError as error:
        raise FormatError(source, [Problem("", str(error))]) from error
    except EnoughProblemsError:
        raise FormatError(source, told(problems, plain.places)) from None
    return Content(definition(plain, source, problems), plain.places, tuple(problems.notes))


def write(machine: MachineDefinition, name: str) -> str:
    """Write a machine.

    Args:
        machine: the definition.
        name: a format of `FORMATS` that can be written.

    Raises:
        MachineError: there is no such format, or it can only be read.
    """
    entry = FORMATS.get(name)
    if entry is None or entry.writes is None:
        written = [known.name for known in FORMATS.values() if known.writes is not None]
        raise MachineError(f"got format {name!r}: {nearest(name, written)}")
    return entry.writes(machine)


def by_suffix(suffix: str) -> str:
    """Name of the format for writing files with a suffix such as ".uxf".

    Raises:
        MachineError: no format that can be written has this suffix.
    """
    known = {suffix: entry.name for entry in FORMATS.values() if entry.writes for suffix in entry.suffixes}
    if suffix.lower() not in known:
        raise MachineError(f"got suffix {suffix!r}: {nearest(suffix, known)}")
    return known[suffix.lower()]


def read_file(path: Path) -> Content:
    """Read a file in any readable format, once: it may be a pipe.

    Raises:
        MachineError: the file cannot be opened.
        FormatError: the file is no machine that can run.
    """
    return _read(_content(path), str(path), path.suffix)


def _content(path: Path) -> bytes:
    """Content of a file, cut off one byte behind `MAX_BYTES`."""
    try:
        with path.open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # a name with a null is a ValueError
        raise MachineError(f"{str(path)[:200]}: cannot be read: {getattr(error, 'strerror', error)}") from error
