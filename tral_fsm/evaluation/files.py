"""Folders and JSON files of results."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError


def prepare_folder(folder: Path, got: str | None = None) -> None:
    """Make a folder if it is missing, and check that it can be written.

    Args:
        folder: the folder.
        got: argument of the command, for the message; None: the option --out.

    Raises:
        ConfigError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        shown = got or f"--out {folder}"
        raise ConfigError(f"{shown}: cannot be written: {error.strerror}: choose another folder") from error


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file at once, in place of an old one."""
    write_bytes(path, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode("utf-8"))
