"""The folder of a search: names of its files, and the results of an earlier search, which are set aside."""

from __future__ import annotations

import contextlib
import itertools
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from tral_fsm.evaluation.files import locked, prepare_folder

STUDY = "study.jsonl"
LOCK = ".lock"
"""Empty file that a search locks while it runs."""
MACHINE, NUMBERS, PAGE = "machine.json", "tune.json", "report.html"
"""Files of the results."""
RESULTS = (MACHINE, NUMBERS, PAGE)


def set_aside(folder: Path, names: Iterable[str]) -> Path | None:
    """Move files of an earlier search into a new folder `before-N` beside them; links stay, their files move.

    Args:
        folder: folder of the search.
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
def held(folder: Path | None) -> Iterator[None]:
    """Hold the folder of a search, so that no other search writes into it; its end frees it, however it comes.

    Args:
        folder: the folder, which is made; None: there is none.

    Raises:
        ConfigError: another search holds it, or it cannot be written.
    """
    if folder is None:
        yield
        return
    prepare_folder(folder)
    with locked(folder / LOCK, f"--out {folder}: another search writes into this folder: give each its own"):
        yield


def aside_said(folder: Path, names: Iterable[str], on_note: Callable[[str], None]) -> None:
    """Set files aside, and say so."""
    before = set_aside(folder, names)
    if before is not None:
        on_note(f"{folder} holds the results of an earlier search: they are now in {before}.")
