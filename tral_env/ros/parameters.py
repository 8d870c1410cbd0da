"""Files of parameters, as ROS 2 writes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from tral_env.errors import BadFileError


def read_parameters(path: Path, node: str) -> dict[str, Any]:
    """The parameters of a node: those below ``/**``, then those below its own name, in any namespace.

    Args:
        path: a file of YAML with ``ros__parameters``.
        node: name of the node, such as "car".

    Raises:
        BadFileError: the file cannot be read, or is no such file.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise BadFileError(f"{path}: cannot be read: {error}") from error
    found: dict[str, Any] = {}
    for name in _matching(content, node, path):
        given = content[name].get("ros__parameters") if isinstance(content[name], dict) else None
        if not isinstance(given, dict):
            raise BadFileError(f"{path}: {name}: expected a mapping 'ros__parameters' below it")
        found |= given
    return found


def _matching(content: Any, node: str, path: Path) -> list[str]:
    if not isinstance(content, dict) or not all(isinstance(name, str) for name in content):
        raise BadFileError(f"{path}: expected the names of nodes, each with 'ros__parameters' below it")
    own = [name for name in content if name.rpartition("/")[2] == node]
    return [*(["/**"] if "/**" in content else []), *own]
