"""From XML text to a small tree that knows its lines, with the expat of Python.

Attacks by XML files use entities, which a document type declares. A machine needs none, so a document type is refused
before anything is read, and nothing is ever fetched.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from tral_env.errors import MachineError

MAX_ELEMENTS = 50_000
"""Largest number of elements. Source: choice; a machine of a hundred states has some thousand."""
MAX_DEPTH = 100
"""Deepest nesting of elements. Source: choice."""

_BEFORE_ROOT = re.compile(r"\s*(?:(?:<\?.*?\?>|<!--.*?-->)\s*)*", re.DOTALL)
"""Declaration, comments and processing instructions before a document type or the root."""
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_NOT_PLAIN = re.compile("[^\t\n\r\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class XMLError(MachineError):
    """A text is no XML, or XML that is refused."""


@dataclass
class Node:
    """An element."""

    tag: str
    """Name; with a namespace: `{namespace}name`."""
    attributes: dict[str, str]
    line: int
    """Line of the file in which the element begins."""
    text: str = ""
    """Text directly in the element."""
    children: list[Node] = field(default_factory=list)

    def all(self, tag: str) -> Iterator[Node]:
        """Children with a tag."""
        return (child for child in self.children if child.tag == tag)

    def child_text(self, tag: str) -> str:
        """Text of the first child with a tag; empty without one."""
        return next((child.text for child in self.all(tag)), "")


class _Builder:
    """Builds the tree from the events of expat."""

    def __init__(self) -> None:
        self.parser = expat.ParserCreate("utf-8", namespace_separator="}")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.data
        self.parser.StartDoctypeDeclHandler = self.doctype
        self.open: list[Node] = []
        self.count = 0
        self.root: Node | None = None

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if self.count > MAX_ELEMENTS:
            raise XMLError(f"more than {MAX_ELEMENTS} XML elements")
        if len(self.open) >= MAX_DEPTH:
            raise XMLError(f"XML elements nested more than {MAX_DEPTH} deep")
        named = {_clark(name): value for name, value in attributes.items()}
        node = Node(_clark(tag), named, self.parser.CurrentLineNumber)
        if self.open:
            self.open[-1].children.append(node)
        else:
            self.root = node
        self.open.append(node)

    def end(self, tag: str) -> None:
        self.open.pop()

    def data(self, text: str) -> None:
        self.open[-1].text += text

    def doctype(self, *_: object) -> None:
        raise XMLError(_NO_DOCTYPE)


_NO_DOCTYPE = "got a document type (<!DOCTYPE ...>), which may hold entities: a machine needs none, delete it"


def parse(text: str) -> Node:
    """Read XML.

    Args:
        text: the whole file, decoded.

    Returns:
        Its root.

    Raises:
        XMLError: the text is no XML, has a document type, is too deep or too large.
    """
    before = _BEFORE_ROOT.match(text)
    if text.startswith("<!DOCTYPE", before.end() if before else 0):
        raise XMLError(_NO_DOCTYPE)
    builder = _Builder()
    try:
        builder.parser.Parse(text.encode("utf-8"), True)
    except expat.ExpatError as error:
        raise XMLError(f"not XML: {error}") from error
    except UnicodeEncodeError as error:
        raise XMLError("not XML: a lone surrogate is no character") from error
    if builder.root is None:
        raise XMLError("not XML: no element")
    return builder.root


def legal(text: str, instead: str = "") -> str:
    """A text without the characters that XML cannot hold."""
    return _NOT_XML.sub(instead, text)


def is_legal(text: str) -> bool:
    """Whether XML can hold each character of a text."""
    return _NOT_XML.search(text) is None


def json_text(text: str) -> str:
    """A JSON text with JSON escapes for control characters, and for characters that XML cannot hold."""
    return _NOT_PLAIN.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def _clark(name: str) -> str:
    return "{" + name if "}" in name else name
