"""Processes that drive can be told to give up."""

from __future__ import annotations

from typing import Any

import pytest

from tral_fsm.evaluation.pool import ProcessPool, StoppedError, spawned, stop_check

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
