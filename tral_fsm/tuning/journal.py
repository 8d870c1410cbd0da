"""The file of a study: a line for the search, then one for each generation. A last line may be cut off."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError
from tral_fsm.evaluation.records import append, damaged, read_lines
from tral_fsm.tuning.folder import NUMBERS, RESULTS, STUDY, aside_said
from tral_fsm.tuning.search.space import Trial, trial

_MAX_SHOWN = 300
"""Characters of a value in a message."""


def refuse_another(what: str, there: Mapping[str, Any], asked: Mapping[str, Any]) -> None:
    """Refuse to go on with the study of another search.

    Raises:
        ConfigError: an entry of the two headers differs.
    """
    for name, value in asked.items():
        was = there.get(name)
        if was == value:
            continue
        if name == "machine":
            raise ConfigError(f"{what} was begun with another machine, or the file has changed since")
        if name == "parameters" and isinstance(was, list):
            was, value = ([each for each in some if each not in other] for some, other in ((was, value), (value, was)))
        raise ConfigError(f"{what} has {name} = {_short(was)}, now {_short(value)} is asked for")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}..."


class Journal:
    """Generations in a file, each written as it ends."""

    def __init__(
        self,
        folder: Path | None,
        header: dict[str, Any],
        *,
        resume: bool,
        on_note: Callable[[str], None] = lambda said: None,
    ) -> None:
        """Begin a study, or go on with the one that is there; the results of an earlier search are set aside.

        Args:
            folder: folder of the file; None: nothing is written.
            header: the search as plain values.
            resume: go on with the file; else set it aside.
            on_note: called with what the user should know.

        Raises:
            ConfigError: there is nothing to resume, or the file is that of another search.
        """
        self.path = None if folder is None else folder / STUDY
        self.generations: list[list[Trial]] = []
        if self.path is None:
            if resume:
                raise ConfigError("to resume a study, its folder must be given")
            return
        header = json.loads(json.dumps(header))
        if resume:
            self._read(header, on_note)
        else:
            self._begin(header, on_note)

    def _begin(self, header: dict[str, Any], on_note: Callable[[str], None]) -> None:
        """Begin a study; one without a generation is replaced."""
        assert self.path is not None
        folder = self.path.parent
        if not self.path.exists() or self.path.read_bytes().count(b"\n") > 1 or (folder / NUMBERS).exists():
            aside_said(folder, (*RESULTS, STUDY), on_note)
        self._write([{"header": header}])

    def _read(self, header: dict[str, Any], on_note: Callable[[str], None]) -> None:
        """Go on with the study that is there."""
        assert self.path is not None
        try:
            lines = read_lines(self.path)
        except OSError as error:
            raise ConfigError(f"{self.path}: there is no study to resume: {error.strerror}") from error
        if not lines or not isinstance(lines[0].get("header"), dict):
            raise ConfigError(f"{self.path}: there is no study to resume: leave out --resume to begin one")
        refuse_another(f"{self.path}: the study", lines[0]["header"], header)
        for number, line in enumerate(lines[1:], 2):
            try:
                self.generations.append([trial(each) for each in line["trials"]])
            except (KeyError, TypeError, ValueError):
                raise damaged(self.path, number) from None
        if len(self.path.read_bytes().splitlines()) > len(lines):
            on_note(f"{self.path}: the last line was cut off: its generation is driven again.")
        if (self.path.parent / NUMBERS).exists():
            aside_said(self.path.parent, RESULTS, on_note)
        self._write([{"header": header}, *lines[1:]])

    def drop_last(self) -> None:
        """Forget the last generation."""
        assert self.path is not None
        self.generations.pop()
        self._write(read_lines(self.path)[:-1])

    def _write(self, lines: Sequence[dict[str, Any]]) -> None:
        assert self.path is not None
        write_bytes(self.path, "".join(json.dumps(line) + "\n" for line in lines).encode("utf-8"))

    def add(self, trials: Sequence[Trial]) -> None:
        """Append a generation, and flush it to the disk."""
        self.generations.append(list(trials))
        if self.path is None:
            return
        append(self.path, {"trials": [each.record() for each in trials]})
