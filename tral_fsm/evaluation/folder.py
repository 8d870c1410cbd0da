"""Folders that one program at a time writes into, and the results of earlier work, which are set aside."""

from __future__ import annotations

import contextlib
import itertools
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

from tral_fsm.evaluation.files import locked, prepare_folder

LOCK = ".lock"
"""Empty file that is locked while a program writes into the folder."""


def set_aside(folder: Path, names: Iterable[str]) -> Path | None:
    """Move files of earlier work into a new folder `before-N` beside them; links stay, their files move.

    Args:
        folder: their folder.
        names: names of the files, of which some may be missing.

    Returns:
        The new folder; None if there is no such file.
    """
    there = [folder / name for name in names if (folder / name).exists()]
    if not there:
        return None
    before = next(folder / f"before-{k}" for k in itertools.count(1) if not (folder / f"before-{k}").exists())
    before.mkdir()
    for path in there:
        shutil.move(path.resolve(), before / path.name)
    return before


@contextlib.contextmanager
def held(folder: Path | None, work: str = "search") -> Iterator[None]:
    """Hold the folder of a search or training, so that no other one writes into it; its end frees it, however it comes.

    Args:
        folder: the folder, which is made; None: there is none.
        work: what writes into it, for the message.

    Raises:
        ConfigError: another one holds it, or it cannot be written.
    """
    if folder is None:
        yield
        return
    prepare_folder(folder)
    with locked(folder / LOCK, f"--out {folder}: another {work} writes into this folder: give each its own"):
        yield
