"""YAML files that people and programs write, read with the line of every key; OpenCV's dialect is understood too."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator
from typing import Any

import yaml

from tral_env.errors import TralError

_OPENCV_HEADER = re.compile(r"\A%YAML:[\d.]+")
"""OpenCV before 5 begins a file so; YAML wants a space after the name of a directive."""
_DECIMAL = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*")
_OPENCV_TAGS = "tag:yaml.org,2002:opencv-"


class Lines(dict[Any, Any]):
    """A mapping, and the line in which each of its keys stands."""

    lines: dict[Any, int]


class Items(list[Any]):
    """A sequence, and the line in which each of its items stands."""

    lines: list[int]


class _Twice(yaml.MarkedYAMLError):  # type: ignore[misc]
    """A key stands twice in a mapping."""


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """Reads plain values alone; a tag of OpenCV only names the type of a mapping or sequence."""


def documents(text: str, where: str, failure: type[TralError]) -> list[Any]:
    """Read all documents of a YAML text but empty ones, as `Lines`, `Items` and plain values.

    Args:
        text: the YAML; a stream such as that of `ros2 topic echo` holds several documents.
        where: name of the file in error messages.
        failure: class of the errors.

    Raises:
        failure: the text is no YAML, or a key stands twice; the message names line and column.
    """
    text = _OPENCV_HEADER.sub(lambda header: "#" + header[0][1:], text)
    try:
        return [found for found in yaml.load_all(text, _Loader) if found is not None]
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{where}:{mark.line + 1}:{mark.column + 1}" if mark else where
        told = getattr(error, "problem", None) or str(error)
        if isinstance(error, _Twice):
            raise failure(f"{place}: {told}") from error
        raise failure(f"{place}: not YAML: {told}{_hint(told)}") from error
    except (RecursionError, ValueError, LookupError, AttributeError) as error:  # also !!bool foo, !!timestamp x
        raise failure(f"{where}: not readable: {error}") from error


def number(value: Any) -> Any:
    """Turn a text that is a decimal number into it; all else stays. YAML 1.1 reads 1e-05, without a point, as text."""
    return float(value) if isinstance(value, str) and _DECIMAL.fullmatch(value) else value


def _hint(problem: str) -> str:
    """What may have led to a problem, as the end of an error message; empty: not known."""
    if "expected ',' or ']'" in problem:
        return ": is a ',' or a ']' missing? Numbers stand in one list: [1, 0, 0]"
    if r"'\t'" in problem:
        return ": a tab; YAML is indented by spaces"
    return ""


def _mapping(loader: _Loader, node: yaml.MappingNode) -> Iterator[Lines]:
    found = Lines()
    found.lines = {}
    yield found
    _require_single_keys(node)
    loader.flatten_mapping(node)
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, Hashable):
            raise yaml.constructor.ConstructorError(None, None, "a key is no plain value", key_node.start_mark)
        found[key] = loader.construct_object(value_node)
        found.lines[key] = key_node.start_mark.line + 1


def _require_single_keys(node: yaml.MappingNode) -> None:
    """Raise an error for a key that stands twice, because the first of its values would be lost."""
    first: dict[str, int] = {}
    for key, _ in node.value:
        if not isinstance(key, yaml.ScalarNode):
            continue
        if key.value in first:
            told = f"'{key.value}' stands twice, first in line {first[key.value]}: delete one of them"
            raise _Twice(None, None, told, key.start_mark)
        first[key.value] = key.start_mark.line + 1


def _sequence(loader: _Loader, node: yaml.SequenceNode) -> Iterator[Items]:
    found = Items()
    found.lines = [item.start_mark.line + 1 for item in node.value]
    yield found
    found.extend(loader.construct_object(item) for item in node.value)


def _of_opencv(loader: _Loader, _: str, node: yaml.Node) -> Any:
    if isinstance(node, yaml.MappingNode):
        return _mapping(loader, node)
    return _sequence(loader, node) if isinstance(node, yaml.SequenceNode) else loader.construct_scalar(node)


_Loader.add_constructor("tag:yaml.org,2002:map", _mapping)
_Loader.add_constructor("tag:yaml.org,2002:seq", _sequence)
_Loader.add_multi_constructor(_OPENCV_TAGS, _of_opencv)
