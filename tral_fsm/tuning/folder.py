"""The folder of a search: names of its files, and the results of an earlier search, which are set aside."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from tral_fsm.evaluation.folder import set_aside

STUDY = "study.jsonl"
MACHINE, NUMBERS, PAGE = "machine.json", "tune.json", "report.html"
"""Files of the results."""
RESULTS = (MACHINE, NUMBERS, PAGE)


def aside_said(folder: Path, names: Iterable[str], on_note: Callable[[str], None]) -> None:
    """Set files aside, and say so."""
    before = set_aside(folder, names)
    if before is not None:
        on_note(f"{folder} holds the results of an earlier search: they are now in {before}.")
