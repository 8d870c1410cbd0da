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


@contextmanager
def _part(path: Path) -> Iterator[Path]:
    """A file that takes the place of another one at the end of the block; an error names that other one."""
    whole = path.resolve()
    part = whole.with_name(f"{whole.name}.{secrets.token_hex(4)}.part")
    try:
        yield part
        part.replace(whole)
    except OSError as error:
        if error.filename in (None, str(part)):  # that of a full disk has no name
            error.filename, error.filename2 = str(path), None
        raise
    finally:
        part.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Replace a file as a whole, also when two programs write it at once. A link stays one; a device is written to.

    Raises:
        OSError: the file cannot be written; the old one is still there.
    """
    if is_device(path):
        path.write_bytes(content)
        return
    with _part(path) as part:
        part.write_bytes(content)


@contextmanager
def whole_file(path: Path) -> Iterator[IO[bytes]]:
    """A file that is written piece by piece, and replaces an older one at the end of the block if nothing failed.

    Raises:
        OSError: the file cannot be written; the old one is still there.
    """
    with _part(path) as part, part.open("wb") as stream:
        yield stream
