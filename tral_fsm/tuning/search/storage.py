"""Storages of studies that several processes share: a journal file, or a database that SQLAlchemy knows."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tral_env.errors import ConfigError, MissingExtraError
from tral_fsm.evaluation.records import damaged

_TRIES = 5
"""Number of tries to open a database: several processes may make the tables of an empty one, and all but one fail."""
_MAX_LINE = 1 << 20
_PASSWORD = re.compile(r"(://[^:/@\s]*:)[^@\s]+(?=@)|([?&]password=)[^&\s]+")


def masked(text: str) -> str:
    """A text with *** for the passwords of its URLs."""
    return _PASSWORD.sub(lambda found: f"{found[1] or found[2]}***", text)


def open_storage(where: str, on_note: Callable[[str], None] = lambda said: None) -> Any:
    """A storage for a study of Optuna, which must be installed.

    Args:
        where: database URL, or journal file; a last line that a process did not finish is removed.
        on_note: called with what the user should know.

    Raises:
        ConfigError: the storage cannot be opened.
        MissingExtraError: the driver of PostgreSQL is not installed.
    """
    if "://" in where:
        return _database(where)
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    path = Path(where.removeprefix("journal:"))
    lock = _mending_lock(path, on_note)
    try:
        _refuse_others(path)
        if _is_torn(path):
            lock.acquire()
            lock.release()
        _refuse_damaged(path)
        return JournalStorage(JournalFileBackend(str(path), lock))
    except OSError as error:
        raise ConfigError(f"--storage {where}: cannot be written: {error.strerror}") from error


def _refuse_others(path: Path) -> None:
    """Refuse a file that is no journal."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        first = file.readline(_MAX_LINE)
    try:
        journal = not first or "op_code" in json.loads(first)
    except (ValueError, TypeError):
        # Another process may be writing the first line.
        journal = first.startswith(b'{"op_code"') and not first.endswith(b"\n")
    if not journal:
        raise ConfigError(f"--storage {path}: is no journal of a study: choose another file")


def _is_torn(path: Path) -> bool:
    """Whether the last line of a file is not finished."""
    if not path.is_file() or path.stat().st_size == 0:
        return False
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) != b"\n"


def _mending_lock(path: Path, on_note: Callable[[str], None]) -> Any:
    """The lock of a journal, under which it is written; it removes a last line whose process ended while it wrote.

    Otherwise the next line would be appended to the unfinished one, and the journal could never be read again.
    """
    from optuna.storages.journal import JournalFileSymlinkLock

    class MendingLock(JournalFileSymlinkLock):
        def acquire(self) -> bool:
            got = super().acquire()
            if _is_torn(path):
                whole = path.read_bytes().rpartition(b"\n")
                os.truncate(path, len(whole[0] + whole[1]))
                on_note(f"--storage {path}: the last line was cut off and is removed; all before it is kept.")
            return got

    return MendingLock(str(path))


def _refuse_damaged(path: Path) -> None:
    """Refuse a journal with a line that cannot be read, which a search could only find after its first drives."""
    whole = path.read_bytes().split(b"\n")[:-1] if path.is_file() else []
    for number, line in enumerate(whole, 1):
        try:
            fits = "op_code" in json.loads(line)
        except (ValueError, TypeError):
            fits = False
        if not fits:
            raise damaged(path, number)


def _database(url: str) -> Any:
    from optuna.storages import RDBStorage
    from sqlalchemy.exc import DBAPIError

    # Which driver the bare scheme means depends on the version of SQLAlchemy.
    named = re.sub(r"^postgres(ql)?://", "postgresql+psycopg://", url)
    for left in reversed(range(_TRIES)):
        with reachable(url):
            try:
                # The connection may have been dropped while the cars drove.
                return RDBStorage(named, engine_kwargs={"pool_pre_ping": True})
            except DBAPIError as error:
                if left == 0 or error.statement is None:  # there is no connection at all
                    raise
            except ImportError as error:
                if "psycopg" in named.partition("://")[0]:
                    raise MissingExtraError("psycopg", "storage", "a study on PostgreSQL") from None
                raise ConfigError(f"--storage {masked(url)}: {error.__cause__}: install this driver") from None
            except ValueError as error:  # of a port that is no number
                raise ConfigError(f"--storage {masked(url)}: {error}") from None
        time.sleep(random.uniform(0.2, 1.0))
    raise AssertionError


@contextlib.contextmanager
def reachable(where: str | None, more: str = "") -> Iterator[None]:
    """Turn errors of a database into a `ConfigError`.

    Args:
        where: database URL; for None and files nothing happens.
        more: end of the message.

    Raises:
        ConfigError: the database cannot be used.
    """
    if where is None or "://" not in where:
        yield
        return
    from optuna.exceptions import StorageInternalError
    from sqlalchemy.exc import SQLAlchemyError

    try:
        yield
    except (SQLAlchemyError, StorageInternalError) as error:
        cause = error.__cause__ if isinstance(error, StorageInternalError) and error.__cause__ else error
        reason = str(getattr(cause, "orig", None) or cause).strip().splitlines()[0]
        raise ConfigError(f"--storage {masked(where)}: {masked(reason)}{more}") from error
