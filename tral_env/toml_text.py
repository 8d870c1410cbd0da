"""TOML files that people write, read with the line of every key: `tomllib` gives the values, a scan gives the lines."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from typing import Any

from tral_env.errors import TralError

Path_ = tuple[str | int, ...]
"""The way to a value: names of tables and keys, and numbers within arrays of tables."""

_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_NAME = rf"{_PART}(?:\s*\.\s*{_PART})*"
_HEADER = re.compile(rf"\s*(\[\[?)\s*({_NAME})\s*\]\]?")
_KEY = re.compile(rf"\s*({_NAME})\s*=")


@dataclass(frozen=True)
class TomlText:
    """The content of a TOML file, and where it stands."""

    content: dict[str, Any]
    where: str
    """Name of the file in error messages."""
    lines: dict[Path_, int]
    """Line of each table and key."""

    def place(self, path: Path_) -> str:
        """Where a value stands, or the nearest table around it: file, line, and the names on the way to it."""
        for length in range(len(path), 0, -1):
            if (line := self.lines.get(path[:length])) is not None:
                return f"{self.where}:{line}: {named(path)}"
        return f"{self.where}: {named(path)}" if path else self.where


def named(path: Path_) -> str:
    """A path as a person writes it: ``sensors[1].bus``, the first of an array being 1."""
    return "".join(f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in path).removeprefix(".")


def parse(text: str, where: str, failure: type[TralError]) -> TomlText:
    """Read TOML.

    Args:
        text: the TOML.
        where: name of the file in error messages.
        failure: class of the errors.

    Raises:
        failure: no TOML; the message names line and column.
    """
    text = text.removeprefix("\ufeff").replace("\r\n", "\n")
    try:
        return TomlText(tomllib.loads(text), where, _lines(text))
    except tomllib.TOMLDecodeError as error:
        raise failure(f"{where}: not TOML: {error}{_hint(text, str(error))}") from error
    except (RecursionError, ValueError) as error:  # nested too deeply, or a number of thousands of digits
        raise failure(f"{where}: not readable: {error}") from error


def _lines(text: str) -> dict[Path_, int]:
    """Line of each table and key that begins a line; what stands within an inline table has the line of that table."""
    found: dict[Path_, int] = {}
    counts: dict[Path_, int] = {}
    table: Path_ = ()
    for number, line in enumerate(text.split("\n"), 1):
        if header := _HEADER.match(line):
            table = _resolved(_parts(header[2]), counts)
            if header[1] == "[[":
                counts[table] = counts.get(table, 0) + 1
                table = (*table, counts[table] - 1)
            found.setdefault(table, number)
        elif key := _KEY.match(line):
            path = (*table, *_parts(key[1]))
            for length in range(len(table) + 1, len(path) + 1):
                found.setdefault(path[:length], number)
    return found


def _resolved(parts: Path_, counts: dict[Path_, int]) -> Path_:
    """The path of a header, with the number of the newest item of each array of tables on the way."""
    path: Path_ = ()
    for place, part in enumerate(parts):
        path = (*path, part)
        if path in counts and place < len(parts) - 1:
            path = (*path, counts[path] - 1)
    return path


def _parts(name: str) -> Path_:
    return tuple(part.strip("\"'") for part in re.findall(_PART, name))


def _hint(text: str, told: str) -> str:
    """What may have led to a text that is no TOML; empty: not known."""
    if (found := re.search(r"line (\d+)", told)) is None:
        return ""
    line = text.split("\n")[int(found[1]) - 1]
    if re.search(r"=\s*-?\d+,\d+\s*(#|$)", line):
        return ": a decimal comma? TOML writes 0.8"
    if re.search(r"=\s*-?\.\d", line):
        return ": TOML writes 0.8, not .8"
    if re.search(r"=\s*(None|null|True|False|yes|no|on|off)\b", line):
        return ': TOML writes true, false, or "text" in quotes'
    if re.search(r"=\s*[/A-Za-z]", line):
        return ': a text stands in "quotes"'
    return ""
