"""Folders and JSON files of results."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError

try:
    import fcntl
except ImportError:  # Windows has no such locks
    fcntl = None  # type: ignore[assignment]

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
        raise ConfigError(f"{shown}: cannot be written: {_why_not(folder, error)}: choose another folder") from error


def _why_not(folder: Path, error: OSError) -> str | None:
    """Why a folder cannot be made; where a file is in the way the system says that the file exists, or is no folder."""
    for place in (folder, *folder.parents):
        if place.is_file():
            return f"{place} is a file, not a folder"
    return error.strerror


@contextlib.contextmanager
def locked(path: Path, refused: str) -> Iterator[None]:
    """Hold a file, which is made if it is missing; the end of the process frees it, however it comes.

    Args:
        path: the file.
        refused: what the error says.

    Raises:
        ConfigError: another process holds it.
    """
    with path.open("ab") as file:
        if fcntl is not None:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise ConfigError(refused) from None
        yield


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file at once, in place of an old one."""
    write_bytes(path, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode("utf-8"))


def write_figure(path: Path, figure: Figure, dpi: int) -> None:
    """Write a figure at once, in place of an old one, in the format of the suffix."""
    content = io.BytesIO()
    figure.savefig(content, format=path.suffix.removeprefix(".").lower(), dpi=dpi)
    write_bytes(path, content.getvalue())
