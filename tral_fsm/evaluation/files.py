"""Folders and JSON files of results."""

from __future__ import annotations

import io
import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


def write_figure(path: Path, figure: Figure, dpi: int) -> None:
    """Write a figure at once, in place of an old one, in the format of the suffix."""
    content = io.BytesIO()
    figure.savefig(content, format=path.suffix.removeprefix(".").lower(), dpi=dpi)
    write_bytes(path, content.getvalue())
