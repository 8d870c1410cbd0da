"""Which format a file is in, from its content or, where that tells nothing, from its suffix."""

from __future__ import annotations

import re
from typing import Any

from tral_env.errors import nearest
from tral_env.json_text import BYTE_ORDER_MARKS, unread
from tral_fsm.formats import tral_json, xml_tree
from tral_fsm.formats.plain import Problems
from tral_fsm.formats.scxml.reader import W3C
from tral_fsm.formats.umlet import uxf, xml2json

_ENCODING = re.compile(rb"<\?xml[^>]{0,200}?encoding\s*=\s*[\"']([A-Za-z0-9._-]{1,40})[\"']")
_ENCODINGS = ("utf-8", "us-ascii", "iso-8859-1", "iso-8859-15", "windows-1252", "utf-16")
"""Encodings that an XML file may declare."""


def decoded(content: bytes) -> str:
    """Text of a file: UTF-8, unless a byte order mark or an XML declaration says otherwise.

    Raises:
        XMLError: the encoding is none of those that are read, or the bytes are no such text.
    """
    declared = _ENCODING.match(content.lstrip()[:300])
    encoding = declared[1].decode("ascii").lower() if declared else "utf-8"
    encoding = next((name for mark, name in BYTE_ORDER_MARKS.items() if content.startswith(mark)), encoding)
    if encoding not in (*_ENCODINGS, "utf-8-sig"):
        raise xml_tree.XMLError(f"got encoding {encoding!r}: {nearest(encoding, _ENCODINGS)}")
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        raise xml_tree.XMLError(unread(error)) from error


def parsed(text: str, suffix: str, problems: Problems) -> tuple[str, Any]:
    """Name of the format of a text, and its values: plain values of JSON, or the outermost XML element.

    Args:
        text: the whole file.
        suffix: suffix of the file; it decides where the beginning of the text does not.
        problems: takes the problems of JSON.

    Raises:
        XMLError: the text is XML of another kind, or a picture.
    """
    start = text.lstrip("\ufeff \t\r\n")
    is_json = start[:1] in ("{", "[") or (start[:1] != "<" and suffix.lower() not in (".uxf", ".scxml", ".xml"))
    if start.startswith(("stateDiagram", "@startuml", "---\ntitle")):
        raise xml_tree.XMLError("Mermaid and PlantUML are written, not read: parameters do not stand in them")
    if is_json:
        value: Any = tral_json.parse(text.removeprefix("\ufeff"), problems)
        return "xml2json" if xml2json.is_one(value) else "json", value
    root = xml_tree.parse(start)
    if root.tag in uxf.ROOTS:
        return "uxf", root
    if root.tag == f"{{{W3C}}}scxml":
        return "scxml", root
    expected = f'expected <diagram> of UMLet, or <scxml xmlns="{W3C}">'
    raise xml_tree.XMLError(f"got <{root.tag[:60]}> as the outermost element: {expected}")
