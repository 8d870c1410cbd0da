"""Files that are written whole: a reader never meets half of one, not even after the writer was interrupted."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO


def is_device(path: Path) -> bool:
    """Whether a path leads to something that is neither a file nor a folder: a pipe, a terminal, /dev/stdout."""
    return path.exists() and not path.is_file() and not path.is_dir()


def write_bytes(path: Path, content: bytes) -> None:
    """Replace a file as a whole, also when two programs write it at once. A link stays one; a device is written to.

    Raises:
        OSError: the file cannot be written; the old one is still there.
    """
    if is_device(path):
        path.write_bytes(content)
        return
    path = path.resolve()
    part = path.with_name(f"{path.name}.{secrets.token_hex(4)}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def whole_file(path: Path) -> Iterator[IO[bytes]]:
    """A file that is written piece by piece, and replaces an older one at the end of the block if nothing failed.

    Raises:
        OSError: the file cannot be written; the old one is still there.
    """
    path = path.resolve()
    part = path.with_name(f"{path.name}.{secrets.token_hex(4)}.part")
    try:
        with part.open("wb") as stream:
            yield stream
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
