"""Parameters in a diagram: JSON members such as `"p": 12,`, or bare ones such as `p: 12` and `side: left`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

MAX_CHARACTERS = 65_536
"""Longest text of an element. Source: choice; the machine office inline has a third of it."""

_BETWEEN = re.compile(r"[\s,]*")
_BLANK = re.compile(r"\s*")
_KEY = re.compile(r'(?:("(?:[^"\\\n]|\\.)*")|([^\W\d]\w*))[ \t]*:[ \t]*')
_END = re.compile(r"[ \t]*(?:[,\n]|\Z)")
_NEXT = re.compile(r',[ \t]*(?:"[^"\n]*"|[^\W\d]\w*)[ \t]*:')
_COMMA = re.compile(r"[-+]?\d+,\d+(?=[ \t]*(?:[,\n]|\Z))")
"""A number with a decimal comma."""
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f]")


def parse(text: str, complain: Callable[[str], None]) -> dict[str, Any]:
    """Read parameters.

    Args:
        text: lines of members; commas between them may be missing at the end of a line.
        complain: called with each fault and its line in the text.

    Returns:
        The readable members. A value that is no JSON is a word, the rest of its line.
    """
    if len(text) > MAX_CHARACTERS:
        complain(f"got {len(text)} characters, at most {MAX_CHARACTERS} are read")
        return {}
    text = _CONTROL.sub(" ", text)
    decoder = _decoder(complain)
    found: dict[str, Any] = {}
    at = _past(_BETWEEN, text, 0)
    while at < len(text):
        key = _KEY.match(text, at)
        if key is None:
            end = _line_end(text, at)
            complain(f"got {_short(text[at:end])} in line {_line(text, at)} of its text, expected: name: value")
        else:
            name, value, end = _member(text, key, decoder, complain)
            if name in found:
                complain(f"got {name!r} twice, again in line {_line(text, at)} of its text")
            found[name] = value
        at = _past(_BETWEEN, text, end)
    return found


def word(text: str) -> Any:
    """A bare value: JSON if it is that, else a word."""
    try:
        return _WORDS.decode(text)
    except (ValueError, RecursionError):
        return text


def _member(
    text: str, key: re.Match[str], decoder: json.JSONDecoder, complain: Callable[[str], None]
) -> tuple[str, Any, int]:
    """Name, value, and end of a member; after a name in quotes the value may stand in the next line, as in JSON."""
    name = str(word(key[1])) if key[1] else key[2]
    at = _past(_BLANK, text, key.end()) if key[1] else key.end()
    comma = _COMMA.match(text, at)
    if comma:
        right = comma[0].replace(",", ".")
        hint = f"write {right}, or several values in brackets"
        complain(f"{name!r}: got {comma[0]} in line {_line(text, at)} of its text: a decimal comma? Then {hint}")
        return name, float(right), comma.end()
    fault = ""
    try:
        value, end = decoder.raw_decode(text, at)
        if _END.match(text, end):
            return name, value, end
    except json.JSONDecodeError as error:
        told = "Unterminated string" if "control character" in error.msg else error.msg  # the only one left is \\n
        fault = f"{told} in line {_line(text, error.pos)} of its text"
    except (RecursionError, ValueError):
        fault = f"nested too deeply, or too long a number, in line {_line(text, at)} of its text"
    if fault and text[at : at + 1] in ('"', "{", "["):
        complain(f"{name!r} is no JSON: {fault}")
        return name, None, len(text)
    end = _line_end(text, key.end())
    following = _NEXT.search(text, key.end(), end)
    end = following.start() if following else end
    return name, text[key.end() : end].strip(" ,"), end


def _decoder(complain: Callable[[str], None]) -> json.JSONDecoder:
    """A JSON decoder for which NaN and Infinity are words, and a repeated name is a fault."""

    def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            complain(f"got a key twice in one object; its keys: {', '.join(found)}"[:300])
        return found

    return json.JSONDecoder(object_pairs_hook=members, parse_constant=str)


def _past(pattern: re.Pattern[str], text: str, at: int) -> int:
    found = pattern.match(text, at)
    return found.end() if found else at


def _line_end(text: str, at: int) -> int:
    end = text.find("\n", at)
    return len(text) if end < 0 else end


def _line(text: str, at: int) -> int:
    return text.count("\n", 0, at) + 1


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")


_WORDS = _decoder(lambda message: None)
