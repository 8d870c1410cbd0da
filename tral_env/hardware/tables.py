"""Tables of a car file, read into frozen dataclasses: every problem is told with its line, and nothing is dropped."""

from __future__ import annotations

import types
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, fields
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from tral_env.checks import check_plausible, is_number
from tral_env.errors import BadFileError, ConfigError, nearest, problem_report
from tral_env.toml_text import Path_, TomlText

_WORDS = {int: "a whole number", float: "a number", bool: "true or false", str: 'a text in "quotes"'}


class Tables:
    """A file while it is read: it collects problems, and raises them all at once."""

    def __init__(self, text: TomlText) -> None:
        """Begin with no problem."""
        self._text = text
        self._problems: list[str] = []

    def refuse(self, path: Path_, problem: str) -> None:
        """Note what is wrong with a value."""
        self._problems.append(f"{self._text.place(path)}: {problem}")

    def refuse_missing(self, path: Path_, name: str) -> None:
        """Note that a table lacks a key."""
        self._problems.append(f"{self._text.place(path)}: '{name}' is missing")

    def finish(self) -> None:
        """End the reading.

        Raises:
            BadFileError: there are problems.
        """
        if self._problems:
            raise BadFileError(problem_report(self._text.where, self._problems))

    def table(self, path: Path_, value: Any) -> dict[str, Any] | None:
        """A value that has to be a table; None: it is none, which is noted."""
        if isinstance(value, dict):
            return value
        self.refuse(path, f"got {value!r}, expected a table: [{path[-1]}]")
        return None

    def known(self, path: Path_, table: Mapping[str, Any], allowed: Iterable[str]) -> None:
        """Note each key that a table may not have."""
        allowed = list(allowed)
        for name in table:
            if name not in allowed:
                self.refuse((*path, name), f"unknown; {nearest(name, allowed)}")

    def build(self, kind: type[Any], path: Path_, table: Mapping[str, Any], given: Iterable[str] = ()) -> Any:
        """A dataclass from a table; None: something is wrong, which is noted.

        Args:
            kind: frozen dataclass; fields that `quantity` made have bounds and a unit.
            path: of the table.
            table: names and values.
            given: names of the table that somebody else reads.
        """
        known = {each.name: each for each in fields(kind) if each.init}
        hints = get_type_hints(kind)
        self.known(path, table, [*known, *given])
        before = len(self._problems)
        values = {}
        for name, each in known.items():
            if name in table:
                values[name] = self._value((*path, name), table[name], hints[name], each)
            elif each.default is MISSING and each.default_factory is MISSING:
                self.refuse_missing(path, name)
        if len(self._problems) > before:
            return None
        try:
            return kind(**values)
        except ConfigError as error:
            self.refuse(path, str(error))
        return None

    def _value(self, path: Path_, value: Any, hint: Any, field: Field[Any]) -> Any:
        """A value of the type of a field, within its bounds; what is wrong is noted."""
        kinds = _members(hint)
        found, fits = _fitted(value, kinds)
        if not fits:
            self.refuse(path, f"got {value!r}, expected {_told(kinds)}{_nearest_choice(value, kinds)}")
        elif "low" in field.metadata and is_number(found):
            bounds = (field.metadata[name] for name in ("low", "high", "unit"))
            try:
                check_plausible("got", found, *bounds)
            except ConfigError as error:
                self.refuse(path, str(error).replace("got = ", "got ", 1))
        return found


def _members(hint: Any) -> tuple[Any, ...]:
    """Types that a hint allows; None, which no file can say, is left out."""
    if get_origin(hint) in (Union, types.UnionType):
        return tuple(kind for part in get_args(hint) for kind in _members(part))
    return () if hint is type(None) else (hint,)


def _fitted(value: Any, kinds: tuple[Any, ...]) -> tuple[Any, bool]:
    """A value as one of some types, and whether it is of one."""
    for kind in kinds:
        if kind in (bool, str) and type(value) is kind:
            return value, True
        if kind is int and is_number(value) and float(value).is_integer():
            return int(value), True
        if kind is float and is_number(value):
            return float(value), True
        if get_origin(kind) is Literal and value in get_args(kind):
            return value, True
        if get_origin(kind) is tuple and isinstance(value, list):
            items = [_fitted(item, (get_args(kind)[0],)) for item in value]
            return tuple(item for item, _ in items), all(fits for _, fits in items)
        if isinstance(get_origin(kind), type) and issubclass(get_origin(kind), Mapping) and isinstance(value, dict):
            inner = {name: _fitted(item, (get_args(kind)[1],)) for name, item in value.items()}
            return {name: item for name, (item, _) in inner.items()}, all(fits for _, fits in inner.values())
    return value, False


def _told(kinds: tuple[Any, ...]) -> str:
    """What is allowed, in words."""
    words = []
    for kind in kinds:
        if get_origin(kind) is Literal:
            words.append(f"one of {', '.join(map(repr, get_args(kind)))}")
        elif get_origin(kind) is tuple:
            words.append(f"a list, each {_told((get_args(kind)[0],))}")
        elif kind in _WORDS:
            words.append(_WORDS[kind])
        else:
            words.append(f"names with {_told((get_args(kind)[1],))} each")
    return " or ".join(words)


def _nearest_choice(value: Any, kinds: tuple[Any, ...]) -> str:
    """The nearest of the literals that are allowed, as the end of a message."""
    literals = [choice for kind in kinds if get_origin(kind) is Literal for choice in get_args(kind)]
    return f"; {nearest(value, literals)}" if literals and isinstance(value, str) else ""
