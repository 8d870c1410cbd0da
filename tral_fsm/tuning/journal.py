"""The file of a study: a line for what was asked, then one for each generation. Half a last line is no harm."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError
from tral_fsm.tuning.search import Trial, trial

NAME = "study.jsonl"


class Journal:
    """Generations on disk, each written as it ends."""

    def __init__(self, folder: Path | None, header: dict[str, Any], *, resume: bool) -> None:
        """Begin a study, or go on with the one that is there.

        Args:
            folder: where the file is; None: nothing is written.
            header: what was asked for, plain values.
            resume: go on; else an old file is replaced.

        Raises:
            ConfigError: there is nothing to resume, or it was asked for something else.
        """
        self.path = None if folder is None else folder / NAME
        self.generations: list[list[Trial]] = []
        if self.path is None:
            if resume:
                raise ConfigError("to resume a study, its folder must be given")
            return
        header = json.loads(json.dumps(header))
        if not resume:
            self._write([{"header": header}])
            return
        lines = self._read()
        if not lines or "header" not in lines[0]:
            raise ConfigError(f"{self.path}: there is no study to resume: leave out --resume to begin one")
        for name, value in header.items():
            was = lines[0]["header"].get(name)
            if was != value:
                raise ConfigError(f"{self.path}: the study has {name} = {was!r}, now {value!r} is asked for")
        self.generations = [[trial(each) for each in line["trials"]] for line in lines[1:]]
        self._write([{"header": header}, *lines[1:]])

    def _read(self) -> list[dict[str, Any]]:
        """Whole lines; what follows the first one that is not is left out."""
        assert self.path is not None
        try:
            text = self.path.read_text(encoding="utf-8")
        except OSError as error:
            raise ConfigError(f"{self.path}: there is no study to resume: {error.strerror}") from error
        lines = []
        for line in text.splitlines():
            try:
                lines.append(json.loads(line))
            except json.JSONDecodeError:
                break
        return lines

    def _write(self, lines: Sequence[dict[str, Any]]) -> None:
        assert self.path is not None
        part = self.path.with_name(f"{NAME}.part")
        part.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
        part.replace(self.path)

    def add(self, trials: Sequence[Trial]) -> None:
        """Write a generation down, so that it is there whatever comes next."""
        self.generations.append(list(trials))
        if self.path is None:
            return
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"trials": [each.record() for each in trials]}) + "\n")
            file.flush()
            os.fsync(file.fileno())
