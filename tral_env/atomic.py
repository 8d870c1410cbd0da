"""Files that are written at once: who reads one, or what interrupts the writing, never meets half of it."""

from __future__ import annotations

from pathlib import Path


def is_device(path: Path) -> bool:
    """Something is there that is neither a file nor a folder."""
    return path.exists() and not path.is_file() and not path.is_dir()


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
