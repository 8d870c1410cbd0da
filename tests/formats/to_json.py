"""What `xml2json` makes of an XML file, with all its quirks."""

import json
from typing import Any
from xml.etree import ElementTree as ET


def xml2json(text: str) -> str:
    root = ET.fromstring(text)
    return json.dumps({root.tag: tag(root)})


def tag(node: ET.Element) -> Any:
    """Attributes get an @, an empty tag is null, a tag that comes twice is an array."""
    attributes = {f"@{name}": value for name, value in node.attrib.items()}
    text = node.text or ""
    if len(node) == 0:
        return {"#text": text, **attributes} if attributes else text or None
    found: dict[str, Any] = dict(attributes)
    for child in node:
        value = tag(child)
        if child.tag not in found:
            found[child.tag] = value
        elif isinstance(found[child.tag], list):
            found[child.tag].append(value)
        else:
            found[child.tag] = [found[child.tag], value]
    return found
