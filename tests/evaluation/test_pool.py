"""Processes that drive give up when they are told to, and end when the process that started them does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from tral_env.errors import LostWorkerError
from tral_fsm.evaluation.pool import ProcessPool, StoppedError, call_all, spawned, stop_check, tell, worker_losses

_began: Any = None
"""Event that tells the pool's owner that the work has begun."""


def keep(began: Any) -> None:
    global _began
    _began = began


def endless() -> None:
    check = stop_check()
    _began.set()
    while True:
        check(0)


def test_an_error_gives_up_what_the_workers_drive() -> None:
    began = spawned.Event()
    with pytest.raises(KeyboardInterrupt), ProcessPool(1, keep, began) as pool:  # noqa: PT012
        future = pool.submit(endless)
        began.wait()
        raise KeyboardInterrupt
    assert isinstance(future.exception(), StoppedError)


def test_a_process_that_is_no_worker_is_never_stopped() -> None:
    check = stop_check()
    for _ in range(100):
        check(0)


def stay() -> None:
    """Work that never ends and hears of nothing."""
    print("begun", flush=True)
    threading.Event().wait()


PARENT = """
import signal
from test_pool import ProcessPool, stay
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup it would be ignored
with ProcessPool(2) as pool:
    [future.result() for future in [pool.submit(stay), pool.submit(stay)]]
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGKILL"])
def test_workers_end_with_their_parent_however_it_ends(name: str) -> None:
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parent
    )
    assert parent.stdout is not None
    assert [parent.stdout.readline(), parent.stdout.readline()] == ["begun\n", "begun\n"]
    parent.send_signal(getattr(signal, name))
    parent.communicate(timeout=30)  # the workers hold the other end of the pipe as long as they live
    assert parent.returncode == -getattr(signal, name)


def kill_itself() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_worker_that_the_system_kills_is_told_with_the_remedy() -> None:
    with pytest.raises(LostWorkerError, match="fewer processes"), ProcessPool(1) as pool, worker_losses():
        pool.submit(kill_itself).result()


def _tells(value: int) -> None:
    tell(value)
    tell("x" * 300_000)  # more than a pipe holds
    if value < 0:
        raise ValueError(value)


def test_what_workers_tell_arrives_also_before_an_error() -> None:
    heard: list[object] = []
    call_all(_tells, [1, 2], 2, heard.append)
    assert sorted(one for one in heard if isinstance(one, int)) == [1, 2]
    assert len(heard) == 4
    heard.clear()
    with pytest.raises(ValueError, match="-3"):
        call_all(_tells, [-3], 1, heard.append)
    assert heard == [-3, "x" * 300_000]


def test_an_error_of_the_hearer_ends_the_calls() -> None:
    def fails(value: object) -> None:
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="the disk is full"):
        call_all(_tells, [1, 2], 1, fails)
