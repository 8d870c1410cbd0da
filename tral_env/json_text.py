"""JSON files that a person writes: a key that stands twice is found, because the first of its values would be lost."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tral_env.errors import TralError, problem_report

BYTE_ORDER_MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
"""Bytes at the beginning of a file -> its encoding."""


class _Object(dict[str, Any]):
    """An object, and the keys that stand in it more than once."""

    repeated: tuple[str, ...] = ()


def read(path: str | Path) -> str:
    """Text of a file in UTF-8, or in UTF-16 with a byte order mark.

    Raises:
        OSError: the file cannot be opened.
        UnicodeDecodeError: it is no such text.
    """
    content = Path(path).read_bytes()
    marked = (name for mark, name in BYTE_ORDER_MARKS.items() if content.startswith(mark) and content != mark)
    return content.decode(next(marked, "utf-8"))


def unread(error: Exception) -> str:
    """Why `read` failed, as the end of an error message."""
    if isinstance(error, UnicodeDecodeError):
        where = f"{error.reason} at byte {error.start}"
        return f"not {error.encoding.upper()} text: {where}: save it as UTF-8, which an editor offers as the encoding"
    return getattr(error, "strerror", None) or str(error)


class NotJsonError(ValueError):
    """A text is no JSON, or none that can be read."""

    def __init__(self, told: str, line: int = 0, column: int = 0) -> None:
        """Tell what is wrong, and in which line and column; 0: in no single place."""
        super().__init__(f"{told} at line {line}, column {column}" if line else told)
        self.told, self.place = told, f":{line}:{column}" if line else ""


def loads(text: str, source: str, failure: type[TralError]) -> Any:
    """Value of a JSON text in which every key stands once in its object.

    Args:
        text: JSON; a byte order mark before it is skipped.
        source: name of the file in error messages.
        failure: class of the errors.

    Raises:
        failure: the text is no JSON, or keys stand more than once; the message says where.
    """
    try:
        value, repeated = parse(text)
    except NotJsonError as error:
        raise failure(f"{source}{error.place}: {error.told}") from error
    if repeated:
        rule = "is there more than once. Allowed: each key once"
        raise failure(problem_report(source, [f"{pointer[:80]}: {rule}" for pointer in repeated]))
    return value


def parse(text: str, constant: Callable[[str], Any] | None = None) -> tuple[Any, list[str]]:
    """Value of a JSON text, and the JSON pointers of the keys that stand more than once, in the order of the text.

    Args:
        text: JSON; a byte order mark before it is skipped.
        constant: gives the value of NaN, Infinity and -Infinity; None: a float.

    Raises:
        NotJsonError: the text is empty, no JSON, nested too deeply, or has a whole number of thousands of digits.
    """
    text = text.removeprefix("\ufeff")
    if not text.strip():
        raise NotJsonError("not JSON: it is empty")
    try:
        value = json.loads(text, object_pairs_hook=_members, parse_constant=constant)
        return value, list(_pointers(value, ""))
    except json.JSONDecodeError as error:
        raise NotJsonError(f"not JSON: {error.msg}{reason(error)}", error.lineno, error.colno) from error
    except RecursionError as error:
        raise NotJsonError("not readable: nested too deeply") from error
    except ValueError as error:
        raise NotJsonError("not readable: a whole number of thousands of digits") from error


def reason(error: json.JSONDecodeError) -> str:
    """What may have led to a text that is no JSON, as the end of an error message; empty: not known."""
    text, at = error.doc, error.pos
    if error.msg == "Extra data" and text[at] in "{[":
        return ": two files in one? Appending (>>) to a file does that, replace it (>)"
    before = text[:at].rstrip()
    if before.endswith(",") and before[-2:-1].isdigit() and text[at : at + 1].isdigit():
        return ": a decimal comma? JSON writes 0.8"
    return next((hint for pattern, hint in _HINTS if re.compile(pattern).match(text, at)), _comma(before, error))


_HINTS = (
    (r"//|/\*|#", ": JSON has no comments; delete it"),
    (r"'", ': JSON writes "double quotes"'),
    (r"[+-]?\.\d|\+\d", ": JSON writes 0.8, not .8 or +0.8"),
)
"""What stands where a text is no JSON, and what may be the reason."""


def _comma(before: str, error: json.JSONDecodeError) -> str:
    """Guess a comma that is missing or too many at an error, by the text before it."""
    if before.endswith(",") and error.doc[error.pos : error.pos + 1] in ("]", "}"):
        return ": a comma too many before it?"
    return ": is a comma missing before it?" if error.msg == "Expecting ',' delimiter" else ""


def whole(value: Any) -> Any:
    """Turn 3.0 into 3, as some programs write whole numbers; all else stays as it is."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _members(pairs: list[tuple[str, Any]]) -> _Object:
    found = _Object(pairs)
    if len(found) < len(pairs):
        found.repeated = tuple(key for key, count in Counter(key for key, _ in pairs).items() if count > 1)
    return found


def _pointers(value: Any, pointer: str) -> Iterator[str]:
    if isinstance(value, _Object):
        yield from (f"{pointer}/{key}" for key in value.repeated)
        for key, item in value.items():
            yield from _pointers(item, f"{pointer}/{key}")
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _pointers(item, f"{pointer}/{index}")
