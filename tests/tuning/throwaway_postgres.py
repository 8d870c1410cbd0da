"""A PostgreSQL server of its own for the tests, on loopback, gone when they are."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

PLACES = ("/usr/lib/postgresql/*/bin", "/usr/pgsql-*/bin", "/opt/homebrew/opt/postgresql*/bin")
"""Where packages put the server's programs; they are seldom on the path."""


def program(name: str) -> str:
    """Path of a program of the server; the test is skipped without."""
    found = shutil.which(name) or next((str(p) for at in PLACES for p in Path("/").glob(f"{at[1:]}/{name}")), None)
    if found is None:
        pytest.skip(f"no PostgreSQL server on this machine: {name} is neither on the path nor in {', '.join(PLACES)}")
    return found


def account() -> dict[str, object]:
    """Whom the server runs as: it refuses to be root."""
    if os.geteuid() != 0:
        return {}
    import pwd

    try:
        entry = pwd.getpwnam("postgres")
    except KeyError:
        pytest.skip("PostgreSQL does not run as root, and there is no account postgres")
    return {"user": entry.pw_uid, "group": entry.pw_gid, "extra_groups": []}


@contextlib.contextmanager
def server() -> Iterator[str]:
    """URL of an empty database of a server that lives as long as this context."""
    psycopg = pytest.importorskip("psycopg")
    initdb, postgres, who = program("initdb"), program("postgres"), account()
    folder = Path(tempfile.mkdtemp(prefix="tral-postgres-"))  # pytest's own is closed to the other account
    process = None
    try:
        if who:
            os.chown(folder, who["user"], who["group"])  # type: ignore[arg-type]
        quiet = {"cwd": folder, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **who}
        subprocess.run([initdb, "-D", folder / "data", "-A", "trust", "-U", "tral", "--no-sync"], check=True, **quiet)
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        options = ["-D", folder / "data", "-p", str(port), "-h", "127.0.0.1", "-k", "", "-F"]
        process = subprocess.Popen([*with_its_parent(), postgres, *options], **quiet)
        url = f"postgresql://tral:secret@127.0.0.1:{port}/postgres"
        deadline = time.monotonic() + 60.0
        while True:
            try:
                psycopg.connect(url).close()
                break
            except psycopg.OperationalError:
                assert time.monotonic() < deadline, "the server does not answer"
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(timeout=0.1)
                    raise AssertionError("the server ended") from None
        yield url
    finally:
        if process is not None:
            process.send_signal(signal.SIGQUIT)  # at once, whoever is connected
            process.wait(timeout=30)
        shutil.rmtree(folder, ignore_errors=True)


def with_its_parent() -> list[str]:
    """What makes a program end when this one is killed, where there is such a thing."""
    setpriv = shutil.which("setpriv")
    return [setpriv, "--pdeathsig", "QUIT", "--"] if setpriv else []
