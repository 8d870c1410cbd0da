"""Machine files with something wrong with them: real ones, changed in bytes, words or structure."""

import copy
import json
import random
import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any
from xml.etree import ElementTree as ET

from to_json import xml2json

from tral_fsm import load_machine, machine_names
from tral_fsm.formats import write

JUNK = [
    "", " ", "0", "-1", "1e999", "NaN", "null", "true", "[]", "{}", '"', "\\", "--", "lt=<-", "lt=->", "&amp;", "&a;",
    "<", ">", "]]>", "<!--", "<!DOCTYPE a [<!ENTITY b 'c'>]>", "\x00", "\ud800", "\u2028", "é", "9" * 5000, "a" * 5000,
    "[" * 2000, '{"a":' * 300, "<a>" * 200, "id", "type", "Motor", "All", "root", "states", "x;y", "10;10;20", "1_0",
    "٣", "\ufeff",
]  # fmt: skip
VALUES: list[Any] = [
    None,
    True,
    0,
    -1,
    1e308,
    10**30,
    "",
    "0",
    "Motor",
    "All",
    "a" * 300,
    [],
    {},
    [None],
    {"id": 0},
    [[]],
]
TOKEN = re.compile(r"\s+|\w+|.", re.DOTALL)


@cache
def originals() -> dict[str, list[str]]:
    """Format -> texts of all packaged machines, but for the longest."""
    machines = [load_machine(name) for name in machine_names() if name != "office"]
    texts = {name: [write(machine, name) for machine in machines] for name in ("json", "uxf", "scxml")}
    return {**texts, "xml2json": [xml2json(text) for text in texts["uxf"]]}


def of_bytes(text: str, rng: random.Random) -> bytes:
    content = bytearray(text.encode())
    for _ in range(rng.randint(1, 6)):
        at = rng.randrange(len(content))
        end = at + rng.choice([0, 1, 1, 2, 8, 64, 1000])
        content[at:end] = rng.choice([b"", bytes([rng.randrange(256)]), content[at:end] * 2, rng.randbytes(3)])
        if not content:
            break
    return bytes(content)


@cache
def _words(text: str) -> tuple[str, ...]:
    return tuple(TOKEN.findall(text))


def of_words(text: str, rng: random.Random) -> bytes:
    words = list(_words(text))
    for _ in range(rng.randint(1, 5)):
        at, other = rng.randrange(len(words)), rng.randrange(len(words))
        new = rng.choice([rng.choice(JUNK), words[other], words[at] * 2, ""])
        words[at : at + rng.choice([0, 1, 1, 5])] = [new]
        if not words:
            break
    return "".join(words).encode("utf-8", "surrogatepass")


def of_json(text: str, rng: random.Random) -> bytes:
    root = json.loads(text)
    for _ in range(rng.randint(1, 4)):
        places = list(_places(root))
        holder, key = rng.choice(places)
        new = copy.deepcopy(rng.choice([rng.choice(VALUES), rng.choice(JUNK), rng.choice(places)[0]]))
        if isinstance(holder, dict) and rng.random() < 0.3:
            holder[rng.choice(JUNK)] = new
        elif rng.random() < 0.2:
            del holder[key]
        else:
            holder[key] = new
        if not any(_places(root)):
            break
    return json.dumps(root).encode("utf-8", "surrogatepass")


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every place of a tree: what holds it, and under which key."""
    if isinstance(value, dict | list):
        for key in list(value) if isinstance(value, dict) else range(len(value)):
            yield value, key
            yield from _places(value[key])


def of_xml(text: str, rng: random.Random) -> bytes:
    root = ET.fromstring(text)
    for _ in range(rng.randint(1, 4)):
        nodes = list(root.iter())
        node, other = rng.choice(nodes), rng.choice(nodes)
        what = rng.randrange(5)
        if what == 0:
            node.text = _spoiled(node.text or "", rng)
        elif what == 1 and node.attrib:
            name = rng.choice(sorted(node.attrib))
            node.attrib[name] = _spoiled(node.attrib[name], rng)
        elif what == 2 and len(node):
            node.remove(node[rng.randrange(len(node))])
        elif what == 3:
            node.append(copy.deepcopy(other))
        else:
            node.tag = other.tag
        if len(nodes) > 3000:
            break
    return ET.tostring(root)


def _spoiled(text: str, rng: random.Random) -> str:
    junk = re.sub("[\x00-\x08\ud800-\udfff]", "", rng.choice(JUNK))
    at = rng.randint(0, len(text))
    return rng.choice([junk, text[:at] + junk + text[at:], text + "\n" + text, text[at:], text.replace("\n", junk)])


WAYS: dict[str, list[Callable[[str, random.Random], bytes]]] = {
    "json": [of_bytes, of_words, of_json],
    "xml2json": [of_bytes, of_words, of_json],
    "uxf": [of_bytes, of_words, of_xml],
    "scxml": [of_bytes, of_words, of_xml],
}


def mutated(name: str, count: int, seed: int) -> Iterator[bytes]:
    """So many spoiled files of a format, always the same for a seed."""
    rng = random.Random(f"{name} {seed}")
    texts = originals()[name]
    for _ in range(count):
        yield rng.choice(WAYS[name])(rng.choice(texts), rng)
