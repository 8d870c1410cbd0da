"""Files that a command leaves: the folder is tried before the work begins, and each file is whole or not there."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError


def prepare_folder(folder: Path, got: str | None = None) -> None:
    """Make a folder if it is missing, and try whether it can be written.

    Args:
        folder: it.
        got: what the command was given, for the message; else the option --out.

    Raises:
        ConfigError: it cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        shown = got or f"--out {folder}"
        raise ConfigError(f"{shown}: cannot be written: {error.strerror}: choose another folder") from error


def write_json(path: Path, content: Any) -> None:
    """Replace a file by a JSON text at once."""
    write_bytes(path, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode("utf-8"))
