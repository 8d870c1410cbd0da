"""Records of drives as lines of JSON: a line for each run with its settings, then a line for each drive as it ends.

A process may be killed while it writes. So a last line that was cut off does not count, and the next line replaces it;
a line before the last one is damaged only by other means, and is refused.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, as_completed
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO

from tral_env.errors import BadFileError, ConfigError
from tral_fsm.definition.machine import MachineDefinition
from tral_fsm.evaluation.cluster import Cluster, Workers
from tral_fsm.evaluation.ending import ending_cleanly
from tral_fsm.evaluation.files import locked
from tral_fsm.evaluation.host import host
from tral_fsm.evaluation.pool import ProcessPool, worker_losses
from tral_fsm.formats import write

Record = dict[str, Any]
Bar = Callable[[int], AbstractContextManager[Callable[[], None]]]
"""Shows so many drives while they run; within it, a call counts one drive."""


_BLOCK = 1 << 16
"""The end of a file is read in blocks of so many bytes."""


def digest(machine: MachineDefinition) -> str:
    """Digest of a machine's content, 16 hexadecimal digits."""
    return hashlib.sha256(write(machine, "json").encode()).hexdigest()[:16]


def read_lines(path: Path) -> list[Record]:
    """All lines but for a last one that was cut off; none if there is no file.

    Raises:
        ConfigError: a line before the last one is damaged, or the file cannot be read.
    """
    lines: list[Record] = []
    try:
        whole = path.read_bytes().splitlines() if path.exists() else []
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}: choose another --out") from error
    for number, text in enumerate(whole, 1):
        line = _parsed(text)
        if isinstance(line, dict):
            lines.append(line)
        elif number < len(whole) or line is not None:
            raise damaged(path, number)
    return lines


def _parsed(line: bytes) -> Any:
    """Value of a line; None if it is no JSON, or no UTF-8."""
    try:
        return json.loads(line)
    except ValueError:
        return None


def damaged(path: Path, number: int) -> BadFileError:
    """Error of a damaged line."""
    return BadFileError(f"{path}:{number}: the line is damaged: mend it, or remove it and all that follows")


def append(path: Path, line: Record) -> None:
    """Append a line, and flush it to the disk; a last line that was cut off is removed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as file:
        _end_line(file)
        file.write((json.dumps(line) + "\n").encode("utf-8"))
        file.flush()
        os.fsync(file.fileno())


def _end_line(file: BinaryIO) -> None:
    """End the last line of a file, or remove it if it does not count (`read_lines`)."""
    start, last = _last_line(file)
    if not last:
        return
    if _parsed(last) is None:
        file.truncate(start)
    elif not last.endswith(b"\n"):
        file.write(b"\n")


def _last_line(file: BinaryIO) -> tuple[int, bytes]:
    """Where the last line of a file begins, and the line with its end."""
    start = file.seek(0, os.SEEK_END)
    last = b""
    while start and b"\n" not in last[:-1]:
        size = min(start, _BLOCK)
        start = file.seek(start - size)
        last = file.read(size) + last
    before = last[:-1].rfind(b"\n") + 1
    return start + before, last[before:]


@contextlib.contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold a file of records, so that no other run writes into it; its end frees it, however it comes.

    Raises:
        ConfigError: another run holds it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with locked(path, f"{path}: another run writes into it: wait for its end, or choose another --out"):
        yield


def begin_run(path: Path, settings: Any, machines: Mapping[str, str] | None = None) -> None:
    """Append the line of a run: settings (a dataclass), digests of the machines by name, and the computer."""
    named = {} if machines is None else {"machines": dict(machines)}
    append(path, {"kind": "run", "settings": asdict(settings), **named, "host": host()})


def made_with(path: Path, settings: Any, machines: Mapping[str, str] | None = None) -> list[Record]:
    """Lines of a file; none if it does not exist.

    Args:
        path: the file.
        settings: settings of the run that goes on with it.
        machines: digests of the machines, by name; the file may hold drives of more machines.

    Raises:
        ConfigError: the file was made with other settings, a machine has changed since, it is no file of records, or
            it is damaged.
    """
    found = read_lines(path)
    if found and found[0].get("kind") != "run":
        raise ConfigError(f"{path}:1: got no line of a run, so these are no records of drives: choose another --out")
    for number, line in enumerate(found, 1):
        is_run = line.get("kind") == "run"
        if not isinstance(line.get("kind"), str) or not isinstance(line.get("machines", {}), dict):
            raise damaged(path, number)
        if is_run and not isinstance(line.get("settings"), dict):
            raise damaged(path, number)
        if is_run and line["settings"] != asdict(settings):
            raise ConfigError(f"{path} was made with {line['settings']}, not {asdict(settings)}: choose another --out")
        now = machines or {}
        changed = [name for name, was in line.get("machines", {}).items() if now.get(name, was) != was]
        if changed:
            raise ConfigError(f"{path}: {', '.join(changed)} changed since it was made: choose another --out")
    return found


def collect(
    drive: Callable[..., list[Record]],
    calls: Sequence[tuple[Any, ...]],
    workers: int | Cluster,
    out: Path,
    on_line: Callable[[], None] = lambda: None,
) -> None:
    """Let workers drive, and append the lines of each call as it ends.

    Args:
        drive: function that returns the lines of some drives.
        calls: arguments of each call.
        workers: number of processes, or a cluster.
        out: the file.
        on_line: called after each line.
    """

    def keep(lines: list[Record]) -> None:
        for line in lines:
            append(out, line)
            on_line()

    if isinstance(workers, Cluster):
        workers.call_all(_called, [(drive, call) for call in calls], lambda _, lines: keep(lines))
        return
    with ProcessPool(workers) as pool, worker_losses():
        futures: list[Future[list[Record]]] = [pool.submit(drive, *call) for call in calls]
        for future in as_completed(futures):
            keep(future.result())


def _called(call: tuple[Callable[..., list[Record]], tuple[Any, ...]]) -> list[Record]:
    drive, arguments = call
    return drive(*arguments)


def drive_missing(
    wanted: Mapping[str, Sequence[Any]],
    drive: Callable[[str, Sequence[Any], Any], list[Record]],
    job_of: Callable[[Record], tuple[str, Any]],
    *,
    out: Path,
    settings: Any,
    machines: Mapping[str, str] | None = None,
    chunk: int,
    processes: Workers,
    bar: Bar,
) -> None:
    """Drive what a file does not hold yet, and append the lines of each chunk as it ends; a run begins with its line.

    Args:
        wanted: family -> its jobs.
        drive: function of family, jobs and settings that returns a line for each job; workers call it.
        job_of: function that gives family and job of the line of a drive.
        out: the file.
        settings: settings of all its drives, a dataclass.
        machines: digests of the machines, by name.
        chunk: largest number of jobs of a call.
        processes: number of workers, or address of a Dask scheduler whose workers drive.
        bar: shows how many drives have ended.

    Raises:
        ConfigError: see `made_with`, `held` and `Cluster`.
    """
    with held(out), contextlib.ExitStack() as stack:
        workers = stack.enter_context(Cluster(processes)) if isinstance(processes, str) else processes
        done = {job_of(line) for line in made_with(out, settings, machines) if line["kind"] != "run"}
        calls: list[tuple[str, Sequence[Any], Any]] = []
        for family, jobs in wanted.items():
            missing = [job for job in jobs if (family, job) not in done]
            calls += [(family, missing[k : k + chunk], settings) for k in range(0, len(missing), chunk)]
        if calls:
            begin_run(out, settings, machines)
            with ending_cleanly(), bar(sum(len(jobs) for _, jobs, _ in calls)) as count:
                collect(drive, calls, workers, out, count)
