"""Files of results: lines that are appended as drives end, JSON that is written at once, tables on the screen."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tral_env.atomic import write_bytes
from tral_env.errors import ConfigError

if TYPE_CHECKING:
    from rich.table import Table

    from tral_fsm.definition.machine import MachineDefinition

Record = dict[str, Any]


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


def print_figures(table: Table) -> None:
    """Print a table of figures at its full width, even if the terminal is narrower."""
    from rich.console import Console

    console = Console()
    full = console.measure(table, options=console.options.update(max_width=sys.maxsize)).maximum
    Console(width=max(console.width, full)).print(table)


def digest(machine: MachineDefinition) -> str:
    """Digest of a machine's content, 16 hexadecimal digits."""
    from tral_fsm.formats import write

    return hashlib.sha256(write(machine, "json").encode()).hexdigest()[:16]


def lines(path: Path) -> Iterator[Record]:
    """Lines of a result file but for lines that were cut off while they were written."""
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            with contextlib.suppress(json.JSONDecodeError):
                yield json.loads(line)


def append(path: Path, line: Record) -> None:
    """Append a line; a last line that was cut off stays apart from it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - 1, 0))
        whole = file.read(1) in (b"", b"\n")
        file.write((("" if whole else "\n") + json.dumps(line) + "\n").encode("utf-8"))


def begin_run(path: Path, settings: Any, machines: Mapping[str, str] | None = None) -> None:
    """Append the line of a run: settings (a dataclass), digests of the machines by name, and the computer."""
    from tral_fsm.evaluation.host import host

    named = {} if machines is None else {"machines": dict(machines)}
    append(path, {"kind": "run", "settings": asdict(settings), **named, "host": host()})


def made_with(path: Path, settings: Any, machines: Mapping[str, str] | None = None) -> list[Record]:
    """Lines of a result file; none if it does not exist.

    Args:
        path: the file.
        settings: settings of the run that goes on with it.
        machines: digests of the machines, by name.

    Raises:
        ConfigError: the file was made with other settings or other machines.
    """
    found = list(lines(path))
    for line in found:
        if line["kind"] == "run" and line["settings"] != asdict(settings):
            raise ConfigError(f"{path} was made with {line['settings']}, not {asdict(settings)}: choose another --out")
        changed = [name for name, was in line.get("machines", {}).items() if was != (machines or {}).get(name)]
        if changed:
            raise ConfigError(f"{path}: {', '.join(changed)} changed since it was made: choose another --out")
    return found


def collect(
    drive: Callable[..., list[Record]], calls: Sequence[tuple[Any, ...]], total: int, processes: int, out: Path
) -> None:
    """Let processes drive, and append the lines of each call as it ends.

    Args:
        drive: function that returns the lines of some drives.
        calls: arguments of each call.
        total: number of lines of all calls.
        processes: number of workers.
        out: the file.
    """
    from rich.console import Console
    from rich.progress import Progress

    from tral_fsm.evaluation.pool import ProcessPool

    with Progress(console=Console(stderr=True)) as bar, ProcessPool(processes) as pool:
        task = bar.add_task("drives", total=total)
        futures: list[Future[list[Record]]] = [pool.submit(drive, *call) for call in calls]
        for future in as_completed(futures):
            for line in future.result():
                append(out, line)
                bar.advance(task)
