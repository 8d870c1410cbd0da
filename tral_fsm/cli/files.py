"""Files that a command leaves: the folder is tried before the work begins, and each file is whole or not there."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

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


def is_device(path: Path) -> bool:
    """Something is there that is neither a file nor a folder."""
    return path.exists() and not path.is_file() and not path.is_dir()


def write_json(path: Path, content: Any) -> None:
    """Replace a file by a JSON text at once: who reads it, or what interrupts this, never meets half of it."""
    write_bytes(path, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Replace a file at once; a link stays one. What is no file (/dev/stdout, a pipe) is written to, not replaced."""
    if is_device(path):
        path.write_bytes(content)
        return
    path = path.resolve()
    part = path.with_name(f"{path.name}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
