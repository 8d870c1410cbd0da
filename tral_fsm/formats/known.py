"""The file formats of machines: by which suffixes and content each is known, what reads it and what writes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.formats import diagram, tral_json
from tral_fsm.formats.plain import Plain, Problems
from tral_fsm.formats.scxml import reader as scxml
from tral_fsm.formats.scxml import writer as scxml_writer
from tral_fsm.formats.umlet import uxf, xml2json


@dataclass(frozen=True)
class Format:
    """A file format of machines."""

    name: str
    suffixes: tuple[str, ...]
    """Suffixes of its files, the usual one first."""
    description: str
    reads: Callable[[Any, Problems], Plain] | None = None
    """Function from values of JSON or the outermost XML element to plain values; None: it can only be written."""
    writes: Callable[[MachineDefinition], str] | None = None
    """Function from a definition to its text; None: the format can only be read."""


FORMATS = {
    entry.name: entry
    for entry in (
        Format("json", (".json",), "TRAL JSON, also of 2016", tral_json.plain, tral_json.dumps),
        Format("uxf", (".uxf",), "UMLet diagram", uxf.plain, uxf.dumps),
        Format("xml2json", (".json",), "UMLet diagram put through xml2json", xml2json.plain),
        Format("scxml", (".scxml", ".xml"), "state chart of the W3C", scxml.plain, scxml_writer.dumps),
        Format("mermaid", (".mmd", ".mermaid"), "picture for Markdown pages", None, diagram.mermaid),
        Format("plantuml", (".puml", ".plantuml"), "picture for PlantUML", None, diagram.plantuml),
    )
}
"""Every format, by name."""
