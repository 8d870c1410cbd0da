"""Text to definition and back, with a module for each format.

Each format becomes the same plain values and a map of places, which one reader validates. So all formats report
problems alike and give the same definition.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from tral_env.errors import MachineError, nearest
from tral_fsm.definition.checks import FormatError, Problem
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.formats import diagram, tral_json, xml_tree
from tral_fsm.formats.plain import EnoughProblemsError, Plain, Problems
from tral_fsm.formats.reader import definition, told
from tral_fsm.formats.scxml import reader as scxml
from tral_fsm.formats.scxml import writer as scxml_writer
from tral_fsm.formats.umlet import uxf, xml2json

MAX_BYTES = 2 * 1024 * 1024
"""Largest size of a file. Source: choice; the largest reference machine has 13,000 bytes."""


@dataclass(frozen=True)
class Format:
    """A file format of machines."""

    name: str
    suffixes: tuple[str, ...]
    """Suffixes of its files, the usual one first."""
    description: str
    reads: bool = True
    writes: Callable[[MachineDefinition], str] | None = None
    """Function from a definition to its text; None: the format can only be read."""


class Content(NamedTuple):
    """What a machine file holds."""

    definition: MachineDefinition
    places: Mapping[str, str]
    """Places in the file as words, by JSON pointer; none for TRAL JSON."""
    notes: tuple[str, ...]
    """What was read and does nothing."""


FORMATS = {
    entry.name: entry
    for entry in (
        Format("json", (".json",), "TRAL JSON, also of 2016", writes=tral_json.dumps),
        Format("uxf", (".uxf",), "UMLet diagram", writes=uxf.dumps),
        Format("xml2json", (".json",), "UMLet diagram put through xml2json"),
        Format("scxml", (".scxml", ".xml"), "state chart of the W3C", writes=scxml_writer.dumps),
        Format("mermaid", (".mmd", ".mermaid"), "picture for Markdown pages", False, diagram.mermaid),
        Format("plantuml", (".puml", ".plantuml"), "picture for PlantUML", False, diagram.plantuml),
    )
}
"""Every format, by name."""

_ENCODING = re.compile(rb"<\?xml[^>]{0,200}?encoding\s*=\s*[\"']([A-Za-z0-9._-]{1,40})[\"']")
_BYTE_ORDER_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
_ENCODINGS = ("utf-8", "us-ascii", "iso-8859-1", "iso-8859-15", "windows-1252", "utf-16")
"""Encodings that an XML file may declare."""


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
        text = content if isinstance(content, str) else _decoded(content)
        size = len(content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content)
        if size > MAX_BYTES:
            raise xml_tree.XMLError(f"got {size} bytes, at most {MAX_BYTES} are read")
        plain = _plain(text, suffix, problems)
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


def _decoded(content: bytes) -> str:
    """Text of a file."""
    declared = _ENCODING.match(content.lstrip()[:300])
    encoding = declared[1].decode("ascii").lower() if declared else "utf-8"
    encoding = next((name for mark, name in _BYTE_ORDER_MARKS.items() if content.startswith(mark)), encoding)
    if encoding not in (*_ENCODINGS, "utf-8-sig"):
        raise xml_tree.XMLError(f"got encoding {encoding!r}: {nearest(encoding, _ENCODINGS)}")
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        raise xml_tree.XMLError(f"not {encoding.upper()} text: {error.reason} at byte {error.start}") from error


def _plain(text: str, suffix: str, problems: Problems) -> Plain:
    """Plain values of a text; its beginning tells the format, else the suffix does."""
    start = text.lstrip("\ufeff \t\r\n")
    is_json = start[:1] in ("{", "[") or (start[:1] != "<" and suffix.lower() not in (".uxf", ".scxml", ".xml"))
    if start.startswith(("stateDiagram", "@startuml", "---\ntitle")):
        raise xml_tree.XMLError("Mermaid and PlantUML are written, not read: parameters do not stand in them")
    if is_json:
        value: Any = tral_json.parse(text.removeprefix("\ufeff"), problems)
        return xml2json.plain(value, problems) if xml2json.is_one(value) else tral_json.plain(value, problems)
    root = xml_tree.parse(start)
    if root.tag in uxf.ROOTS:
        return uxf.plain(root, problems)
    if root.tag == f"{{{scxml.W3C}}}scxml":
        return scxml.plain(root, problems)
    expected = f'expected <diagram> of UMLet, or <scxml xmlns="{scxml.W3C}">'
    raise xml_tree.XMLError(f"got <{root.tag[:60]}> as the outermost element: {expected}")


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
