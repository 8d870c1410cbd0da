"""Files of parameters, as ROS 2 writes them."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from tral_env import yaml_text
from tral_env.errors import BadFileError, nearest

_ALL = "/**"
"""What stands below this name is for all nodes."""


def read_parameters(
    path: Path,
    nodes: Mapping[str, Collection[str]],
    wanted: Collection[str],
    namespace: str | None = None,
    refused: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """The parameters of nodes: those below ``/**``, then those below their names, such as ``car`` in any namespace.

    A name with a namespace, such as ``/car1/car``, is for the node of that namespace alone, and counts most. One that
    stands below ``/**`` is for the nodes that have it. What the file says of other nodes than the wanted ones is
    checked too, so that a wrong name is found by whichever command reads the file first; nodes that are not ours are
    passed over.

    Args:
        path: a file of YAML with ``ros__parameters``.
        nodes: name of each node of ours, such as "car" -> its parameters.
        wanted: the nodes whose parameters are wanted, as one process has them.
        namespace: of these nodes, such as "/car1"; None: the parameter `namespace` of the file says it.
        refused: name of a parameter that no file may give -> why.

    Raises:
        BadFileError: the file cannot be read, or is no such file; a node has no such parameter, or no file may give
            it; two of the wanted nodes are given one parameter with two values.
    """
    sections = _sections(path)
    for section, given in sections.items():
        _check(path, section, given, nodes, refused or {})
    shared = {
        name: value for name, value in sections.get(_ALL, {}).items() if any(name in nodes[one] for one in wanted)
    }
    found = shared | _own(path, sections, wanted)
    where = str(found.get("namespace", "")) if namespace is None else namespace
    return found | _own(path, sections, [f"{where.strip('/')}/{one}" for one in wanted])


def _own(path: Path, sections: Mapping[str, dict[str, Any]], names: Collection[str]) -> dict[str, Any]:
    """What stands below the names of nodes of one process.

    Raises:
        BadFileError: a parameter has two values.
    """
    found: dict[str, Any] = {}
    said: dict[str, str] = {}
    for section, given in sections.items():
        bare = section.strip("/")
        if (bare if "/" in bare else section) not in names:  # /car is the node of the root, car that of any namespace
            continue
        for name, value in given.items():
            if name in said and found[name] != value:
                raise BadFileError(
                    f"{path}: {said[name]} and {section} have two values of '{name}', and one process has one: "
                    f"say it once, below {_ALL}"
                )
            found[name], said[name] = value, section
    return found


def _check(
    path: Path,
    section: str,
    given: Mapping[str, Any],
    nodes: Mapping[str, Collection[str]],
    refused: Mapping[str, str],
) -> None:
    """Refuse a section with a parameter that its node lacks or no file may give, or of a node that is a slip."""
    node = section.rpartition("/")[2]
    if section == _ALL:
        known = {name for parameters in nodes.values() for name in parameters}
    elif node in nodes:
        known = set(nodes[node])
    else:
        return _check_foreign(path, section, node, nodes)
    for name in given:
        if name in refused:
            raise BadFileError(f"{path}: {section}: {name}: {refused[name]}")
        if name not in known:
            raise BadFileError(f"{path}: {section}: unknown parameter '{name}': {nearest(name, sorted(known))}")
    return None


def _sections(path: Path) -> dict[str, dict[str, Any]]:
    """Name of each node in the file -> what it is given."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadFileError(f"{path}: cannot be read: {error}") from error
    found = yaml_text.documents(text, str(path), BadFileError)
    content = found[0] if len(found) == 1 else None
    if not isinstance(content, dict) or not all(isinstance(name, str) for name in content):
        raise BadFileError(f"{path}: expected the names of nodes, each with 'ros__parameters' below it")
    sections: dict[str, dict[str, Any]] = {}
    for name, below in content.items():
        given = below.get("ros__parameters") if isinstance(below, dict) else None
        if not isinstance(given, dict):
            raise BadFileError(f"{path}: {name}: expected a mapping 'ros__parameters' below it")
        if beside := sorted(map(str, set(below) - {"ros__parameters"})):
            raise BadFileError(f"{path}: {name}: '{beside[0]}' stands beside 'ros__parameters', not below it")
        sections[name] = given
    return sections


def _check_foreign(path: Path, section: str, node: str, nodes: Collection[str]) -> None:
    """Refuse the section of a node that is not ours, where it looks like a slip."""
    if "*" in section:
        raise BadFileError(f"{path}: {section}: the only pattern that is known is {_ALL}")
    if close := difflib.get_close_matches(node, nodes, 1):
        raise BadFileError(f"{path}: {section}: is no node of ours; did you mean '{close[0]}'?")
